"""Lets docstrings say |x| and mean an absolute value, which reStructuredText would look up."""

import re

_LITERAL_OR_BAR = re.compile(r"``[^`]+``|`[^`]+`|\|")


def escape(app, what, name, obj, options, lines):
    """Escape bars outside of literals, line by line and in place."""
    lines[:] = [
        _LITERAL_OR_BAR.sub(lambda m: r"\|" if m[0] == "|" else m[0], line) for line in lines
    ]


def setup(app):
    """Register with Sphinx."""
    app.connect("autodoc-process-docstring", escape)
    return {"parallel_read_safe": True}
