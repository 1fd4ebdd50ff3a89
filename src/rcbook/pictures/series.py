"""The numbers behind a figure, read from its curves, points, bars and maps, as CSV in long form.

The build offers them under each figure.  What has no place in data coordinates (schematics, whose
axes are off, and lines across the axes that have no label) is decoration and left out.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Iterator
from itertools import chain

import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.collections import PathCollection, PolyCollection, QuadMesh
from matplotlib.container import BarContainer
from matplotlib.contour import ContourSet
from matplotlib.figure import Figure
from matplotlib.image import AxesImage
from matplotlib.lines import Line2D
from matplotlib.patches import StepPatch
from matplotlib.ticker import FixedLocator, FuncFormatter

COLUMNS = ("panel", "series", "x_name", "y_name", "x", "y", "value")
DIGITS = 6

Series = tuple[str, Iterable, Iterable, Iterable | None]  # name, x, y, and the values of a map


def long_form(figure: Figure) -> str | None:
    """The numbers of `figure` as CSV, one point a row, or None when it shows no data.

    Only maps and coloured points have a `value`; the column is not there without them.
    """
    panels = [(ax, found) for ax in figure.axes if _is_panel(ax) and (found := list(_series(ax)))]
    if not panels:
        return None
    rows = []
    for number, (ax, found) in enumerate(panels, 1):
        panel = _title(ax) or (f"panel {number}" if len(panels) > 1 else "")
        for name, x, y, values in found:
            head = (panel, name, _label(ax.xaxis, ax), _label(ax.yaxis, ax))
            points = zip(x, y, strict=True) if values is None else zip(x, y, values, strict=True)
            rows += [(*head, *map(_shown, point)) for point in points]
    mapped = any(values is not None for _, found in panels for *_, values in found)
    written = io.StringIO()
    sheet = csv.writer(written, lineterminator="\n")
    sheet.writerow(COLUMNS if mapped else COLUMNS[:-1])
    sheet.writerows((*row, "")[: len(COLUMNS)] if mapped else row for row in rows)
    return written.getvalue()


def _is_panel(ax: Axes) -> bool:
    return ax.axison and ax.get_visible() and ax.get_label() != "<colorbar>"


def _title(ax: Axes) -> str:
    titles = (" ".join(ax.get_title(loc=place).split()) for place in ("left", "center", "right"))
    return next(filter(None, titles), "")


def _label(axis: Axis, ax: Axes) -> str:
    """The label of an axis; it may stand at another panel of its column or row, or beside all."""
    is_x = axis is ax.xaxis
    beside = [other for other in ax.figure.axes if _same_line(ax, other, is_x)]
    others = (other.get_xlabel() if is_x else other.get_ylabel() for other in beside)
    whole = ax.figure.get_supxlabel() if is_x else ax.figure.get_supylabel()
    polar = ("angle (rad)" if is_x else "radius") if ax.name == "polar" else ""
    labels = (axis.get_label_text(), *others, whole, polar)
    return next((" ".join(label.split()) for label in labels if label.strip()), "xy"[not is_x])


def _same_line(ax: Axes, other: Axes, column: bool) -> bool:
    """Whether two panels stand in one column, or in one row, of a grid."""
    place, there = ax.get_subplotspec(), other.get_subplotspec()
    if place is None or there is None or place.get_gridspec() is not there.get_gridspec():
        return False
    return place.colspan == there.colspan if column else place.rowspan == there.rowspan


def _shown(value: float | str) -> str:
    if isinstance(value, str):
        return value
    masked = value is np.ma.masked or not np.isfinite(value)
    return "" if masked else f"{float(value):.{DIGITS}g}"


def _series(ax: Axes) -> Iterator[Series]:
    shown = [artist for artist in ax.get_children() if artist.get_visible()]
    lines = [artist for artist in shown if isinstance(artist, Line2D)]
    yield from _numbered(chain.from_iterable(_line(ax, line) for line in lines), "curve")
    yield from _numbered(_points(ax, shown), "points")
    yield from _numbered(_bars(ax), "bars")
    yield from _numbered((_steps(a) for a in shown if isinstance(a, StepPatch)), "steps")
    bands = (a for a in shown if isinstance(a, PolyCollection) and not isinstance(a, QuadMesh))
    yield from _numbered((_outline(band) for band in bands), "outline")
    for artist in shown:
        if isinstance(artist, ContourSet):
            yield _contours(artist)
        elif isinstance(artist, QuadMesh):
            yield _mesh(artist)
        elif isinstance(artist, AxesImage) and artist.get_array().ndim == 2:
            yield _image(ax, artist)


def _numbered(found: Iterable[Series], kind: str) -> Iterator[Series]:
    """Series whose label is none of an author's, which begins with `_`, named by their number."""
    for number, (label, *data) in enumerate(found, 1):
        named = label.strip() and not label.startswith("_")
        yield (" ".join(label.split()) if named else f"{kind} {number}", *data)


def _line(ax: Axes, line: Line2D) -> Iterator[Series]:
    along_x, along_y = line.get_transform().contains_branch_seperately(ax.transData)
    x, y = line.get_xdata(orig=False), line.get_ydata(orig=False)
    if along_x and along_y:
        yield line.get_label(), x, y, None
    elif (along_x or along_y) and not line.get_label().startswith("_"):  # right across the axes
        yield line.get_label(), x[:1] if along_x else [""], y[:1] if along_y else [""], None


def _points(ax: Axes, shown: Iterable) -> Iterator[Series]:
    for artist in shown:
        placed = isinstance(artist, PathCollection) and artist.get_offset_transform()
        if placed and placed.contains_branch(ax.transData):
            x, y = np.ma.asarray(artist.get_offsets()).T
            yield artist.get_label(), x, y, artist.get_array()


def _bars(ax: Axes) -> Iterator[Series]:
    for bars in ax.containers:
        if isinstance(bars, BarContainer):
            boxes = [(b.get_x(), b.get_y(), b.get_width(), b.get_height()) for b in bars.patches]
            left, below, width, height = np.array(boxes).reshape(-1, 4).T
            if bars.orientation == "horizontal":
                x, y = left + width, _named(ax.yaxis, below + height / 2)
            else:
                x, y = _named(ax.xaxis, left + width / 2), below + height
            yield bars.get_label(), x, y, None


def _steps(steps: StepPatch) -> Series:
    values, edges, _ = steps.get_data()
    return steps.get_label(), edges, [*values, values[-1]], None


def _outline(band: PolyCollection) -> Series:
    x, y = _apart([path.vertices for path in band.get_paths()])
    return band.get_label(), x, y, None


def _contours(contours: ContourSet) -> Series:
    """Each level line, or the outline of each filled layer with the middle of its values."""
    pieces = [(piece, v) for v, at in zip(contours.cvalues, contours.allsegs, strict=True)
              for piece in at]  # fmt: skip
    x, y = _apart([piece for piece, _ in pieces])
    values = [v for piece, value in pieces for v in (*[value] * len(piece), np.nan)]
    return _of_map(contours), x, y, values[: len(x)]


def _apart(pieces: Iterable[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """The corners of several pieces one after another, an empty point between each two."""
    gap = np.full((1, 2), np.nan)
    parts = [part for piece in pieces for part in (piece, gap)][:-1]
    corners = np.concatenate(parts) if parts else np.empty((0, 2))
    return corners[:, 0], corners[:, 1]


def _mesh(mesh: QuadMesh) -> Series:
    corners = mesh.get_coordinates()
    centres = (corners[1:, 1:] + corners[1:, :-1] + corners[:-1, 1:] + corners[:-1, :-1]) / 4
    x, y = centres.reshape(-1, 2).T
    return _of_map(mesh), x, y, np.ma.ravel(mesh.get_array())


def _image(ax: Axes, image: AxesImage) -> Series:
    """The cells of an image by their centres, or by the words that stand there on the axes.

    What is drawn as shades of something else says in `numbers` what that is.
    """
    shades = image.get_array()
    rows, columns = shades.shape
    left, right, bottom, top = image.get_extent()
    first, last = (top, bottom) if image.origin == "upper" else (bottom, top)
    x = _named(ax.xaxis, left + (right - left) * (np.arange(columns) + 0.5) / columns)
    y = _named(ax.yaxis, first + (last - first) * (np.arange(rows) + 0.5) / rows)
    values = np.ma.ravel(getattr(image, "numbers", shades))
    return _of_map(image), list(x) * rows, [place for place in y for _ in range(columns)], values


def _of_map(artist: ContourSet | QuadMesh | AxesImage) -> str:
    """What the values of a map are: the label of its colour bar, or its own."""
    bar = artist.colorbar.ax if artist.colorbar is not None else None
    own = "" if artist.get_label().startswith("_") else artist.get_label()
    return (bar.get_ylabel() or bar.get_xlabel() if bar is not None else "") or own or "map"


def _named(axis: Axis, places: np.ndarray) -> list:
    """`places`, or the words at the ticks of `axis` where each of them has one."""
    shown, at = axis.get_major_formatter(), axis.get_major_locator()
    if not isinstance(shown, FuncFormatter) or not isinstance(at, FixedLocator):
        return list(places)  # where words are given to ticks, a function finds them by their places
    words = {round(float(p), 9): shown(p) for p in at.locs}
    found = [words.get(round(float(place), 9), "") for place in places]
    return found if all(found) else list(places)
