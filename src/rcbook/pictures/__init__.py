"""Pictures of the book: block diagrams, machines and results, each drawn on a given axes.

A new machine gets a module of its own here.  Its `draw_` functions return the axes and are handed
on by this package; those that need nothing but axes, with the machine's parameters as defaults, are
made for a figure of about 8 by 4.2 inches, and the tests find them and apply their rules.
"""

import importlib
import pkgutil
from collections.abc import Callable, Iterable

from rcbook.pictures.blocks import Block, Frame, Node, Sum, Wire, path, row
from rcbook.pictures.results import GREY, LABELS, mark_revolutions, table, use_style
from rcbook.pictures.sketch import Sketch
from rcbook.pictures.sliders import with_sliders


def drawings(folders: Iterable[str]) -> dict[str, Callable]:
    """Every `draw_` function of the modules in these folders, by name.

    Raises ValueError when two modules have different ones of the same name.
    """
    modules = (
        importlib.import_module(f"{__name__}.{m.name}") for m in pkgutil.iter_modules(folders)
    )
    found: dict[str, Callable] = {}
    for module in modules:
        for name, draw in vars(module).items():
            if name.startswith("draw_") and found.setdefault(name, draw) is not draw:
                raise ValueError(f"{module.__name__}.{name} is taken; call it otherwise")
    return found


globals().update(drawings(__path__))
