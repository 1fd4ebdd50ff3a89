"""Gives the entries of the bibliography the role that its list asks for."""


def mend(app, pagename, templatename, context, doctree):
    """Entries of a list are its items; the role they come with is deprecated."""
    if body := context.get("body"):
        context["body"] = body.replace('role="doc-biblioentry"', 'role="listitem"')


def setup(app):
    """Register with Sphinx."""
    app.connect("html-page-context", mend)
    return {"parallel_read_safe": True}
