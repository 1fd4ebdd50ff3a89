"""A comparison: the loop that all controllers take a place in, and heat maps of what they do."""

from collections.abc import Collection

import numpy as np
import pandas as pd
from matplotlib import colormaps
from matplotlib.axes import Axes

from rcbook.pictures import blocks
from rcbook.pictures.blocks import Block, Node, Sum, Wire, path
from rcbook.pictures.sketch import DISTURBED, FOCUS, PLANT

_SPAN = np.log(4)  # of the greys at least, so that what is equal looks equal
_DARK = 0.55  # of the map, beyond which text is white


def draw_contest(ax: Axes) -> Axes:
    """Draw the loop in which controllers are compared: each corrects what the plant gets anyway."""
    items = [
        Node("split", (1.0, 0.0)),
        Sum("error", (2.4, 0.0)),
        Block("controller", "a controller", (5.2, 0.0), FOCUS),
        Sum("added", (8.0, 0.0), {"w": "+", "n": "+"}),
        Sum("load", (10.2, 0.0), {"w": "+", "n": "+"}),
        Block("plant", "a machine", (12.6, 0.0), PLANT),
        Node("out", (14.8, 0.0)),
        Sum("sensor", (8.0, -2.2), {"e": "+", "s": "+"}),
    ]
    wires = [
        *path((0.0, 0.0), "$r$", "split", "", "error", "", "controller", "", "added"),
        *path("added", "$v$", "load", "", "plant", "", "out", "$y$", (16.0, 0.0)),
        Wire("split", "added", via=1.8),
        Wire((10.2, 1.8), "load", "disturbance", color=DISTURBED),
        *(Wire("out", "sensor", via=-2.2), Wire("sensor", "error", via=-2.2)),
        Wire((8.0, -3.8), "sensor", "noise", color=DISTURBED),
    ]
    return blocks.draw_block_diagram(ax, items, wires)


def draw_heat_map(
    ax: Axes,
    values: pd.DataFrame,
    title: str = "",
    high_is_good: bool = False,
    marked: Collection[tuple[str, str]] = (),
    never: str = "∞",
) -> Axes:
    """Draw positive numbers as greys on a logarithmic scale, dark where they are bad.

    Every cell shows its number; `never` stands for an infinite one, a dash for none, and a star
    behind those of the `marked` (row, column).
    """
    numbers = values.to_numpy(dtype=float)
    usual = np.isfinite(numbers) & (numbers > 0)
    logs = np.log(np.where(usual, numbers, 1.0))
    low, high = (logs[usual].min(), logs[usual].max()) if usual.any() else (0.0, 0.0)
    shade = np.where(usual, (logs - low) / max(high - low, _SPAN), numbers > 0)
    shade = 0.75 * (1 - shade if high_is_good else shade)
    pale = np.ma.masked_where(np.isnan(numbers), shade)
    image = ax.imshow(pale, cmap=colormaps["Greys"], vmin=0, vmax=1, aspect="auto")
    image.numbers = numbers  # the build offers them as CSV
    for i, row in enumerate(values.index):
        for j, column in enumerate(values.columns):
            text = _shown(numbers[i, j], never) + "*" * bool(
                usual[i, j] and (row, column) in marked
            )
            color = "white" if not np.isnan(numbers[i, j]) and shade[i, j] > _DARK else "black"
            ax.text(j, i, text, ha="center", va="center", color=color, fontsize=9)
    ax.set_xticks(range(values.shape[1]), values.columns, fontsize=9)
    ax.set_yticks(range(values.shape[0]), values.index, fontsize=9)
    ax.set_title(title, fontsize=10.5)
    ax.grid(False)
    ax.tick_params(length=0)
    ax.spines[:].set_visible(False)
    return ax


def _shown(number: float, never: str) -> str:
    if np.isnan(number):
        return "–"
    if np.isinf(number):
        return never
    if 0 < number < 1e-3:
        return "<0.001"
    return f"{number:.2g}" if number < 10 else f"{number:.0f}"
