"""Finds every drawing of the pictures, renders it, and holds it to the rules of the house.

A rule takes a drawn axes and fails with words; `tests/test_pictures.py` applies all of them to all
drawings, and plants faults to see them caught.
"""

import dataclasses
import importlib
import inspect
import pkgutil
from functools import cache, partial
from itertools import combinations, pairwise

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg, RendererAgg
from matplotlib.colors import to_rgb
from matplotlib.patches import Circle, FancyBboxPatch
from matplotlib.path import Path
from matplotlib.transforms import Bbox

from rcbook import machines, pictures

STYLE = "rcbook.pictures.rcbook"
PHONE = (8.0, 4.2)
SIZES = (PHONE, (5.0, 3.0), (12.0, 3.0))


def modules(package):
    """The modules of a package."""
    names = (info.name for info in pkgutil.iter_modules(package.__path__))
    return [importlib.import_module(f"{package.__name__}.{name}") for name in names]


def discover():
    """Every `draw_` function that needs nothing but axes, by name, and what varies it.

    Varied are the optional texts (all given) and the parameter set of a machine (all that the
    library holds).  `results` draws curves on axes with ticks, which other tests look at.
    """
    named = [pair for module in modules(machines) for pair in vars(module).items()]
    found = {}
    for module in modules(pictures):
        for name, draw in inspect.getmembers(module, inspect.isfunction):
            if module is pictures.results or not name.startswith("draw_"):
                continue
            _, *parameters = inspect.signature(draw).parameters.values()
            if draw.__module__ != module.__name__ or any(p.default is p.empty for p in parameters):
                continue
            found[name] = draw
            texts = {p.name: p.name.replace("_", " ") for p in parameters if p.default == ""}
            if texts:
                found[f"{name}, all texts"] = partial(draw, **texts)
            for p in parameters:
                for label, value in named if dataclasses.is_dataclass(p.default) else ():
                    if type(value) is type(p.default) and value is not p.default:
                        found[f"{name}, {label}"] = partial(draw, **{p.name: value})
    return found


@cache
def rendered(draw, size=PHONE):
    """A drawing's figure and axes; kept between tests, which only look."""
    with plt.style.context(STYLE):
        figure, ax = plt.subplots(figsize=size)
        assert draw(ax) is ax, "a drawing returns its axes"
        figure.draw_without_rendering()
    plt.close(figure)
    return figure, ax


# --- what is on a drawing ------------------------------------------------------------------------


@cache
def text_boxes(ax):
    """Pixels that each text inks, in display coordinates; `Text` itself reports whole lines."""
    width, height = map(int, ax.figure.bbox.size)
    renderer = RendererAgg(width, height, ax.figure.dpi)
    boxes = {}
    for text in ax.texts:
        renderer.clear()
        text.draw(renderer)
        rows, columns = np.nonzero(np.asarray(renderer.buffer_rgba())[..., 3])
        if rows.size:  # else it is off the figure altogether
            x, y = columns.min(), height - rows.max()
            box = Bbox([[x, y - 1], [columns.max() + 1, height - rows.min()]])
        else:
            box = text.get_window_extent(renderer)
        boxes[text.get_text(), *text.get_position()] = box
    return boxes


@cache
def ground(ax):
    """The pixels without the words, RGB, top row first."""
    for text in ax.texts:
        text.set_visible(False)
    canvas = FigureCanvasAgg(ax.figure)
    canvas.draw()
    pixels = np.array(canvas.buffer_rgba())[..., :3].astype(int)
    for text in ax.texts:
        text.set_visible(True)
    return pixels


def under(ax, box):
    """The pixels of the ground in a box of display coordinates."""
    pixels = ground(ax)
    (x0, y0), (x1, y1) = np.clip(box.get_points(), 0, pixels.shape[1::-1]).astype(int)
    return pixels[pixels.shape[0] - y1 : pixels.shape[0] - y0, x0:x1].reshape(-1, 3)


def wires(ax):
    """Corners of every wire in data coordinates; the last is the tip of its head, if it has one."""
    tips = np.array([p.get_xy()[0] for p in ax.patches if p.get_gid() == "wire head"])
    found = []
    for line in ax.lines:
        if line.get_gid() == "wire":
            route = line.get_xydata().copy()
            near = [tip for tip in tips if 0 < np.hypot(*(tip - route[-1])) < 0.2]
            if near:
                route[-1] = near[0]
            found.append(route)
    return found


def outlines(ax):
    """Corners and circles of everything a wire may point at, in data coordinates."""
    patches = [p for p in ax.patches if p.get_gid() != "wire head"]
    boxes = [
        (p.get_x(), p.get_y(), p.get_width(), p.get_height())
        for p in patches
        if isinstance(p, FancyBboxPatch)
    ]
    return boxes, [(*p.center, p.radius) for p in patches if isinstance(p, Circle)]


def on_ink(ax, point):
    """Whether a point is on the outline of a shape, in a dot, or on a line that is no wire."""
    if any(abs(r - np.hypot(*(point - (x, y)))) < 1e-6 for x, y, r in outlines(ax)[1]):
        return True
    if any(r < 0.1 and np.hypot(*(point - (x, y))) < r for x, y, r in outlines(ax)[1]):
        return True
    shapes = [p for p in ax.patches if p.get_gid() != "wire head" and not isinstance(p, Circle)]
    curves = [p.get_patch_transform().transform_path(p.get_path()) for p in shapes]
    curves += [Path(line.get_xydata()) for line in ax.lines if line.get_gid() != "wire"]
    corners = (c for curve in curves for c in curve.to_polygons(closed_only=False))
    return any(distance(point, a, b) < 1e-6 for c in corners for a, b in pairwise(c))


def distance(point, start, end):
    """Distance of a point from a segment."""
    along, length = np.subtract(end, start), np.sum(np.subtract(end, start) ** 2)
    share = np.clip(np.dot(point - start, along) / length, 0, 1) if length else 0.0
    return np.hypot(*(point - (start + share * along)))


def lightness(color):
    """Relative luminance as the web accessibility guidelines (WCAG 2) define it."""
    rgb = np.array(to_rgb(color))
    linear = np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)
    return float(linear @ [0.2126, 0.7152, 0.0722])


def contrast(one, other):
    """Contrast of two colours as the same guidelines define it, from 1 to 21."""
    dark, light = sorted((lightness(one), lightness(other)))
    return (light + 0.05) / (dark + 0.05)


# --- the rules -----------------------------------------------------------------------------------


def texts_stay_inside_and_apart(ax):
    """No text leaves the figure or touches another."""
    figure, boxes = ax.figure.bbox, text_boxes(ax)
    for (text, *_), box in boxes.items():
        assert figure.x0 < box.x0 and box.x1 < figure.x1, f"{text!r} leaves the figure"
        assert figure.y0 < box.y0 and box.y1 < figure.y1, f"{text!r} leaves the figure"
    for (one, first), (other, second) in combinations(boxes.items(), 2):
        assert not first.overlaps(second), f"{one[0]!r} lies on {other[0]!r}"


def texts_lie_on_even_ground(ax):
    """What is under a text has one colour: no line, arrow head or outline runs through it."""
    for (text, *_), box in text_boxes(ax).items():
        assert np.ptp(under(ax, box), axis=0).max() == 0, f"something runs through {text!r}"


def texts_stand_out_from_their_ground(ax):
    """4.5:1 is the accessibility guidelines' threshold for body text (WCAG 2, level AA)."""
    for text, box in zip(ax.texts, text_boxes(ax).values(), strict=True):
        ratio = contrast(text.get_color(), np.median(under(ax, box), axis=0) / 255)
        assert ratio >= 4.5, f"{text.get_text()!r} stands out by {ratio:.2g}:1 only"


def wires_turn_at_right_angles(ax):
    """Every piece of a wire is level or upright."""
    for route in wires(ax):
        assert np.abs(np.diff(route, axis=0)).min(axis=1).max() < 1e-9, f"{route} is slanted"


def wires_do_not_cross(ax):
    """Wires meet at dots only."""
    pieces = [(a, b) for route in wires(ax) for a, b in pairwise(route)]
    dots = [(x, y) for x, y, r in outlines(ax)[1] if r < 0.1]
    for (a, b), (c, d) in combinations(pieces, 2):
        (x0, x1), (y0, y1) = sorted((a[0], b[0])), sorted((c[1], d[1]))
        at = c[0], a[1]
        if abs(a[0] - b[0]) < 1e-9:
            (x0, x1), (y0, y1), at = sorted((c[0], d[0])), sorted((a[1], b[1])), (a[0], c[1])
        inside = x0 + 1e-6 < at[0] < x1 - 1e-6 and y0 + 1e-6 < at[1] < y1 - 1e-6
        marked = any(np.hypot(at[0] - x, at[1] - y) < 1e-6 for x, y in dots)
        assert not inside or marked, f"wires cross at {at}"


def wires_begin_and_end_on_ink(ax):
    """A free tail carries a label; a free tip is the output, which only one is, and at the rim."""
    free = [route for route in wires(ax) if not on_ink(ax, route[-1])]
    assert len(free) <= 1, f"wires end nowhere, at {[route[-1] for route in free]}"
    corners = [p.get_extents().transformed(ax.transData.inverted()).corners() for p in ax.patches]
    ink = np.concatenate([*corners, *(line.get_xydata() for line in ax.lines), *wires(ax)])
    for route in free:
        step = np.sign(np.round(route[-1] - route[-2], 9))
        beyond = (ink @ step).max() - route[-1] @ step
        assert beyond < 1e-6, f"a wire ends nowhere, at {route[-1]}"
    for route in wires(ax):
        words = [np.array(t.get_position()) for t in ax.texts if t.get_text() not in "+−"]
        named = any(distance(at, a, b) < 0.3 for at in words for a, b in pairwise(route))
        assert named or on_ink(ax, route[0]), f"a wire begins nowhere, at {route[0]}"


RULES = (
    texts_stay_inside_and_apart,
    texts_lie_on_even_ground,
    texts_stand_out_from_their_ground,
    wires_turn_at_right_angles,
    wires_do_not_cross,
    wires_begin_and_end_on_ink,
)
