"""The few icons of the theme as a style sheet, for a script of 1.5 MB that holds two thousand."""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path

_TAG = re.compile(r'<script defer src="([^"]*_static/)scripts/fontawesome\.js[^"]*"></script>')
_USED = re.compile(r'class="[^"]*\bfa[sb]?(?:-solid|-brands)? fa-([a-z-]+)')
_MADE_BY_SCRIPTS = {"xmark"}
_RULES = """.fa-solid::before, .fas::before {
  content: "";
  display: inline-block;
  width: calc(var(--wide) * 1em);
  height: 1em;
  vertical-align: -0.125em;
  background: currentColor;
  mask: var(--icon) center / contain no-repeat;
}
.fa-lg {
  font-size: 1.25em;
}
"""


def replace(html: Path) -> None:
    """Give the pages in the folder `html` a sheet of the icons that they use, and drop the script.

    Raises ValueError for an icon that the theme's script does not have.
    """
    script = html / "_static" / "scripts" / "fontawesome.js"
    texts = {page: page.read_text(encoding="utf-8") for page in html.rglob("*.html")}
    used = {name for text in texts.values() for name in _USED.findall(text)}
    sheet = style_sheet(script.read_text(encoding="utf-8"), used | _MADE_BY_SCRIPTS)
    (html / "_static" / "icons.css").write_text(sheet, encoding="utf-8")
    for page, text in texts.items():
        linked = _TAG.sub(r'<link rel="stylesheet" href="\1icons.css" />', text)
        page.write_text(linked, encoding="utf-8", newline="\n")
    for file in script.parent.glob("fontawesome.js*"):
        file.unlink()


def style_sheet(script: str, names: Iterable[str]) -> str:
    """Rules that draw the icons `names` as the script of Font Awesome would.

    Raises ValueError for an icon that the script does not have.
    """
    return _RULES + "".join(_rule(script, name) for name in sorted(names))


def _rule(script: str, name: str) -> str:
    shape = re.search(
        rf'[{{,]"?{re.escape(name)}"?:\[(\d+),(\d+),\[[^]]*\],"\w+","([^"]+)"', script
    )
    if not shape:
        raise ValueError(
            f"the theme's icons have no {name}; take another or mend rcbook.book.icons"
        )
    width, height, outline = shape.groups()
    drawing = (
        f"%3Csvg xmlns='http://www.w3.org/2000/svg' viewBox='0 0 {width} {height}'%3E"
        f"%3Cpath d='{outline}'/%3E%3C/svg%3E"
    )
    wide = int(width) / int(height)
    return f'.fa-{name} {{ --wide: {wide:g}; --icon: url("data:image/svg+xml,{drawing}"); }}\n'
