"""Pictures with sliders: curves at every setting, computed beforehand and moved by the reader.

In a notebook and in print such a picture stands still, at the setting it starts from.  What the
built book needs to move it travels with the picture, as data.
"""

from __future__ import annotations

import base64
import io
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import product

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_hex
from matplotlib.lines import Line2D

MIME = "application/vnd.rcbook.sliders+json"
DIGITS = 4  # of what is sent to the page; a screen shows three
FEW = range(6, 101)  # points of a curve that is drawn with them; fewer are a line to compare with
_SIZE = (8, 3.8)
_DASHES = {"-": "solid", "--": "dashed", "-.": "dashdot", ":": "dotted"}  # as the page calls them


@dataclass(frozen=True)
class Frame:
    """The picture at one setting of the sliders."""

    curves: Mapping[str, tuple[np.ndarray, np.ndarray]]  # x and y by label
    note: str  # what the picture shows at this setting, in words


@dataclass(frozen=True)
class SliderPlot:
    """A picture at every setting of its sliders."""

    sliders: Mapping[str, Sequence[float]]  # settings by what is set, in ascending order
    start: Sequence[float]  # the setting that stands in a notebook and in print
    frames: Sequence[Frame]  # at all settings, that of the last slider changing fastest
    axes: Mapping[str, object]  # what `Axes.set` is given

    def setting(self) -> str:
        """The setting of the start in words."""
        pairs = zip(self.sliders, self.start, strict=True)
        return ", ".join(f"{name} {value:g}" for name, value in pairs)

    def at(self, *setting: float) -> Frame:
        """The picture at one value of each slider.  Raises ValueError when they are no setting."""
        settings = list(product(*self.sliders.values()))
        if setting not in settings:
            raise ValueError(f"{setting} is no setting of {', '.join(self.sliders)}; take one")
        return self.frames[settings.index(setting)]

    def _repr_mimebundle_(self, include=None, exclude=None) -> dict:
        figure, ax = plt.subplots(figsize=_SIZE)
        draw_frame(ax, self)
        lines = list(ax.get_lines())
        picture = io.BytesIO()
        figure.savefig(picture, format="png", dpi="figure")
        plt.close(figure)
        return {
            "text/plain": f"{self.setting()}: {self.at(*self.start).note}",
            "image/png": base64.b64encode(picture.getvalue()).decode(),
            MIME: _data(self, lines),
        }


def with_sliders(
    frame: Callable[..., tuple[Mapping, str]],
    sliders: Mapping[str, Sequence[float]],
    start: Sequence[float],
    *,
    xlabel: str,
    ylabel: str,
    xlim: tuple[float, float],
    ylim: tuple[float, float],
    yscale: str = "linear",
) -> SliderPlot:
    """The picture that `frame` makes of every setting of `sliders`, a mapping of what is set to
    ascending values; `frame` is given one value of each and returns curves, as (x, y) by label,
    and a note in words.

    Raises ValueError when `start` is no setting, when a setting has other curves than the start,
    and for a curve that is no pair of vectors of one length.
    """
    frames = [_frame(*frame(*setting)) for setting in product(*sliders.values())]
    axes = {"xlabel": xlabel, "ylabel": ylabel, "xlim": xlim, "ylim": ylim, "yscale": yscale}
    plot = SliderPlot(sliders, tuple(start), frames, axes)
    labels = list(plot.at(*start).curves)
    for setting, each in zip(product(*sliders.values()), frames, strict=True):
        if (found := list(each.curves)) != labels:
            raise ValueError(
                f"at {setting} the curves are {', '.join(found)}, not {', '.join(labels)}; "
                "draw the same ones at every setting"
            )
    return plot


def _frame(curves: Mapping, note: str) -> Frame:
    arrays = {name: tuple(np.asarray(v, float) for v in xy) for name, xy in curves.items()}
    for name, (x, y) in arrays.items():
        if x.ndim != 1 or x.shape != y.shape:
            raise ValueError(
                f"{name} has x of shape {x.shape} and y of {y.shape}; "
                "a curve is two vectors of one length"
            )
    return Frame(arrays, note)


def draw_frame(ax: Axes, plot: SliderPlot) -> Axes:
    """The picture of `plot` at its start, with the setting and the note as title."""
    still = plot.at(*plot.start)
    for name, (x, y) in still.curves.items():
        ax.plot(x, y, label=name, marker="." if x.size in FEW else "")
    ax.set(**plot.axes)
    ax.set_title(f"{plot.setting()}\n{still.note}", fontsize="medium")
    ax.figure.legend(loc="outside lower left", ncols=3, fontsize="small")
    return ax


def _data(plot: SliderPlot, lines: Sequence[Line2D]) -> dict:
    """The picture as JSON; curves are pairs of places among `vectors`, which are kept once."""
    vectors: dict[tuple, int] = {}

    def place(values: np.ndarray) -> int:
        rounded = [float(f"{v:.{DIGITS}g}") if np.isfinite(v) else None for v in values]
        return vectors.setdefault(tuple(rounded), len(vectors))

    frames = [[[place(x), place(y)] for x, y in f.curves.values()] for f in plot.frames]
    return {
        "axes": dict(plot.axes),
        "sliders": [
            {"label": name, "settings": [f"{v:g}" for v in values], "start": list(values).index(v0)}
            for (name, values), v0 in zip(plot.sliders.items(), plot.start, strict=True)
        ],
        "curves": [
            {
                "label": line.get_label(),
                "color": to_hex(line.get_color()),
                "dash": _DASHES[line.get_linestyle()],
                "points": line.get_marker() == ".",
            }
            for line in lines
        ],
        "vectors": [list(values) for values in vectors],
        "frames": frames,
        "notes": [f.note for f in plot.frames],
    }
