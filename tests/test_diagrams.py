"""The drawings: what a wire may say, that text stays readable, that grey print loses nothing."""

from functools import cache
from itertools import combinations, pairwise

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt
import numpy as np
import pytest
from matplotlib.backends.backend_agg import RendererAgg
from matplotlib.colors import to_rgb
from matplotlib.patches import Circle, FancyBboxPatch, Polygon
from matplotlib.transforms import Bbox

from rcbook import diagrams, plot
from rcbook.diagrams import Block, Frame, Node, Sum, Wire, draw_block_diagram
from rcbook.machines import boring_bar, face_mill, lathe

F_REF, V_PI = r"$F_\mathrm{ref}$", r"$V_\mathrm{PI}$"


def feedback(ax, **kwargs):
    kwargs = {"error": r"$e_\mathrm{PI}$"} | kwargs
    return diagrams.draw_feedback_loop(ax, "PI", "milling", F_REF, V_PI, "$F$", **kwargs)


def cascade(ax, **kwargs):
    errors = {"outer_error": "$e_r$", "inner_error": r"$e_\mathrm{PI}$"}
    texts = ("$G_r$", "PI", "milling", F_REF, "$V_r$", V_PI, "$F$")
    return diagrams.draw_cascade_loop(ax, *texts, **errors, **kwargs)


def plugin(ax, **kwargs):
    texts = ("repetitive\ncontroller", "PI", "spindle", "$r$", "$u$", "$y$")
    return diagrams.draw_plugin_loop(ax, *texts, error="$e$", correction="$v$", **kwargs)


def lumped(ax):
    plant = r"$\dfrac{z^{-d}\,Q(z^{-1})}{P(z^{-1})}$"
    texts = ("$G_r(z)$", plant, F_REF, "$V_r$", "$F$")
    return diagrams.draw_feedback_loop(ax, *texts, error="$e_r$", focus=True)


LAYOUTS = {
    "feedback": feedback,
    "feedback, disturbed": lambda ax: feedback(ax, disturbance="$W$", plant_input="$V$"),
    "feedback, a fraction as plant": lumped,
    "feedback, long texts": lambda ax: feedback(
        ax, disturbance="runout $W(k)$", plant_input="feed command $V$", error="force error"
    ),
    "cascade": cascade,
    "cascade, disturbed": lambda ax: cascade(ax, disturbance="$W$"),
    "cascade, framed": lambda ax: cascade(
        ax, disturbance="$W$", plant_input="$V$", inner_loop="closed PI loop $z^{-d}Q/P$"
    ),
    "plug-in": plugin,
    "plug-in, disturbed": lambda ax: plugin(ax, disturbance="$w$"),
    "generator": diagrams.draw_repetitive_generator,
    "milling": diagrams.draw_milling_setup,
    "lathe": diagrams.draw_lathe_setup,
    "learning": diagrams.draw_learning_loop,
    "spindle drive": diagrams.draw_spindle_drive,
    "angle loop": diagrams.draw_angle_loop,
    "face mill": diagrams.draw_face_mill_setup,
    "boring": diagrams.draw_boring_setup,
    "periodic sampling": diagrams.draw_periodic_sampling,
    "periodic loop": diagrams.draw_periodic_loop,
    "regeneration": diagrams.draw_regeneration,
}
MACHINES = {"milling", "lathe", "face mill", "boring", "periodic sampling", "regeneration"}
ROUND = {"learning", "angle loop"}  # whose signals all go round


@pytest.fixture(autouse=True)
def house_style():
    with plt.style.context("rcbook.rcbook"):
        yield
    plt.close("all")


@cache
def rendered(draw, size=(8.0, 4.2)):
    # kept between tests, which only look
    figure, ax = plt.subplots(figsize=size)
    assert draw(ax) is ax
    figure.draw_without_rendering()
    return figure, ax


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
        x, y = columns[[columns.argmin(), columns.argmax()]], height - rows[[-1, 0]]
        boxes[text.get_text(), *text.get_position()] = Bbox([[x[0], y[0] - 1], [x[1] + 1, y[1]]])
    return boxes


def outlines(ax):
    """Corners and circles of everything a wire may point at, in data coordinates."""
    boxes, circles = [], []
    for patch in ax.patches:
        if isinstance(patch, FancyBboxPatch):
            boxes.append((patch.get_x(), patch.get_y(), patch.get_width(), patch.get_height()))
        elif isinstance(patch, Circle):
            circles.append((*patch.center, patch.radius))
    return boxes, circles


def heads(ax):
    """Tips of the arrow heads: triangles whose first corner is the tip."""
    found = [p.get_xy() for p in ax.patches if isinstance(p, Polygon) and len(p.get_xy()) == 4]
    return [xy[0] for xy in found]


def lightness(color):
    """Relative luminance as the web accessibility guidelines (WCAG 2) define it."""
    rgb = np.array(to_rgb(color))
    linear = np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)
    return float(linear @ [0.2126, 0.7152, 0.0722])


def contrast(one, other):
    dark, light = sorted((lightness(one), lightness(other)))
    return (light + 0.05) / (dark + 0.05)


# --- what a diagram refuses ----------------------------------------------------------------------


def test_a_name_used_twice_is_named():
    _, ax = plt.subplots()
    with pytest.raises(ValueError, match=r"two items are named 'pi': give every item its own"):
        draw_block_diagram(ax, [Block("pi", "PI"), Node("pi", (2, 0))], [])


@pytest.mark.parametrize("ends", [("pi", "plnat"), ("plnat", "pi")])
def test_a_wire_to_an_unknown_name_lists_the_known_ones(ends):
    _, ax = plt.subplots()
    with pytest.raises(ValueError, match=r"'plnat', which is not drawn: use one of 'pi', 'sum'"):
        draw_block_diagram(ax, [Block("pi", "PI"), Sum("sum", (3, 0))], [Wire(*ends)])


def test_a_wire_into_a_sum_needs_a_sign_on_its_side():
    _, ax = plt.subplots()
    wires = [Wire((3.0, 2.0), "sum")]
    with pytest.raises(ValueError, match=r"'sum' from side 'n', which has no sign: add 'n'"):
        draw_block_diagram(ax, [Sum("sum", (3, 0))], wires)


def test_a_wire_of_no_length_is_refused():
    _, ax = plt.subplots()
    with pytest.raises(ValueError, match=r"'pi' to 'pi' has no length"):
        draw_block_diagram(ax, [Block("pi", "PI")], [Wire("pi", "pi")])


def test_a_refused_diagram_leaves_no_ink():
    _, ax = plt.subplots()
    with pytest.raises(ValueError, match="not drawn"):
        draw_block_diagram(ax, [Block("pi", "PI")], [Wire("pi", "out")])
    assert not ax.patches
    assert not ax.texts


# --- where wires end -----------------------------------------------------------------------------


def test_arrow_tips_lie_on_the_outlines_they_point_at():
    _, ax = plt.subplots()
    items = [
        Block("box", "box", (0, 0), width=2.0, height=1.0),
        Sum("sum", (4, 0), signs={"w": "+", "n": "-"}),
        Node("dot", (6, 0)),
        Frame("all", (3, 0), 8.0, 3.0),
    ]
    wires = [
        Wire((-3.0, 0.0), "box"),
        Wire("box", "sum", "$u$"),
        Wire((4.0, 2.0), "sum", "$w$"),
        Wire("sum", "dot"),
        Wire("dot", "box", via=-1.2),
    ]
    draw_block_diagram(ax, items, wires)
    radius = outlines(ax)[1][0][2]
    tips = {(round(float(x), 9), round(float(y), 9)) for x, y in heads(ax)}
    assert tips == {(-1.0, 0.0), (4.0 - radius, 0.0), (4.0, radius), (0.0, -0.5)}  # none at a dot


@pytest.mark.parametrize("name", sorted(LAYOUTS.keys() - MACHINES))
def test_every_arrow_of_a_layout_ends_on_ink_or_is_the_output(name):
    _, ax = rendered(LAYOUTS[name])
    boxes, circles = outlines(ax)
    loose = 0
    for x, y in heads(ax):
        on_box = any(
            (np.isclose(abs(x - left - w / 2) - w / 2, 0) and abs(y - low - h / 2) <= h / 2)
            or (np.isclose(abs(y - low - h / 2) - h / 2, 0) and abs(x - left - w / 2) <= w / 2)
            for left, low, w, h in boxes
        )
        on_circle = any(np.isclose(np.hypot(x - cx, y - cy), r) for cx, cy, r in circles)
        loose += not (on_box or on_circle)
    assert loose == (name not in ROUND)


@pytest.mark.parametrize("name", LAYOUTS)
def test_wires_turn_only_at_right_angles(name):
    _, ax = rendered(LAYOUTS[name])
    for line in ax.lines:
        if line.get_solid_joinstyle() == "miter":  # a wire; not the drawing of a machine
            steps = np.abs(np.diff(line.get_xydata(), axis=0))
            assert np.all(np.isclose(steps.min(axis=1), 0.0))


# --- what a reader sees --------------------------------------------------------------------------


@pytest.mark.parametrize("size", [(8.0, 4.2), (5.0, 3.0), (12.0, 3.0)])
@pytest.mark.parametrize("name", LAYOUTS)
def test_texts_stay_inside_the_figure_and_apart(name, size):
    figure, ax = rendered(LAYOUTS[name], size)
    boxes = text_boxes(ax)
    assert len(boxes) >= 6
    for text, box in boxes.items():
        assert figure.bbox.x0 <= box.x0, text
        assert figure.bbox.y0 <= box.y0, text
        assert box.x1 <= figure.bbox.x1, text
        assert box.y1 <= figure.bbox.y1, text
    for (one, first), (other, second) in combinations(boxes.items(), 2):
        assert not first.overlaps(second), (one, other)


@pytest.mark.parametrize("size", [(8.0, 4.2), (5.0, 3.0)])
@pytest.mark.parametrize("name", LAYOUTS)
def test_text_is_inside_a_shape_or_clear_of_all_of_them(name, size):
    _, ax = rendered(LAYOUTS[name], size)
    blocks = [p.get_window_extent() for p in ax.patches if isinstance(p, FancyBboxPatch)]
    circles = [p.get_window_extent() for p in ax.patches if isinstance(p, Circle)]
    circles = [((c.x0 + c.x1) / 2, (c.y0 + c.y1) / 2, c.width / 2) for c in circles]
    for text, box in text_boxes(ax).items():
        for block in blocks:
            inside = all(block.contains(*corner) for corner in box.corners())
            assert inside or not box.overlaps(block), text
        for x, y, radius in circles:
            nearest = np.clip(x, box.x0, box.x1), np.clip(y, box.y0, box.y1)
            clear = np.hypot(nearest[0] - x, nearest[1] - y) > radius
            assert clear or np.hypot(*(box.corners() - (x, y)).T).max() < radius, text


@pytest.mark.parametrize("size", [(8.0, 4.2), (5.0, 3.0)])
@pytest.mark.parametrize("name", LAYOUTS)
def test_no_line_and_no_arrow_head_runs_through_a_text(name, size):
    _, ax = rendered(LAYOUTS[name], size)
    lines = [line for line in ax.lines if line.zorder >= 1]  # what lies below is covered
    tips = [p.get_window_extent() for p in ax.patches if isinstance(p, Polygon)]
    tips = [box for box in tips if box.width < 30 and box.height < 30]
    for text, box in text_boxes(ax).items():
        for line in lines:
            path = ax.transData.transform_path(line.get_path())
            assert not path.intersects_bbox(box, filled=False), text
        assert not any(box.overlaps(tip) for tip in tips), text


@pytest.mark.parametrize("name", LAYOUTS)
def test_text_on_a_phone_has_at_least_eight_pixels(name):
    """390 pixels wide, drawn for 8 inches: 8 px is what the smallest system fonts use."""
    _, ax = rendered(LAYOUTS[name], (8.0, 4.2))
    if name != "feedback, long texts":
        assert min(t.get_fontsize() for t in ax.texts) / 72 * 390 / 8 >= 8.0


@pytest.mark.parametrize("name", LAYOUTS)
def test_all_text_is_readable_in_grey(name):
    """4.5:1 is the accessibility guidelines' threshold for body text (WCAG 2, level AA)."""
    _, ax = rendered(LAYOUTS[name])
    for text in ax.texts:
        for fill in (diagrams.PAPER, diagrams.PLANT, diagrams.FOCUS):
            assert contrast(text.get_color(), fill) >= 4.5


def test_fills_differ_in_grey():
    """Outlines do the work; the tints of machine and controller only must not fall together."""
    for one, other in combinations((diagrams.PAPER, diagrams.PLANT, diagrams.FOCUS), 2):
        assert contrast(one, other) > 1.15
    assert contrast(diagrams.PLANT, diagrams.STEEL) > 1.15  # a turned section on its bar


def test_a_drawing_keeps_its_scale_when_the_figure_is_large():
    _, small = rendered(feedback, (8.0, 4.0))
    _, large = rendered(feedback, (16.0, 8.0))
    assert {t.get_fontsize() for t in small.texts} == {t.get_fontsize() for t in large.texts}


def test_text_and_drawing_shrink_together():
    sizes = {}
    for width in (4.0, 2.0):
        figure, ax = rendered(cascade, (width, width / 2))
        unit = np.ptp(ax.transData.transform([(0, 0), (1, 0)])[:, 0])
        sizes[width] = ax.texts[0].get_fontsize() * figure.dpi / unit
    assert sizes[4.0] == pytest.approx(sizes[2.0], rel=1e-6)


# --- the learning loop ---------------------------------------------------------------------------


def test_learning_names_every_signal_of_a_pass():
    _, ax = rendered(diagrams.draw_learning_loop)
    words = [t.get_text() for t in ax.texts]
    signals = ("$y_r$", "$e_L$", "$y_{m,L}$", "$y_{m,L+1}$", "$y_L$")
    assert [words.count(s) for s in (*signals, "$G$", "$H$", "memory of\none pass")] == [1] * 8
    assert (words.count("+"), words.count("−")) == (3, 1)


def test_learning_goes_round_from_memory_to_plant_to_law_to_memory():
    """Above to the right, below to the left: every text where its signal is."""
    _, ax = rendered(diagrams.draw_learning_loop)
    at = {t.get_text(): t.get_position() for t in ax.texts}
    above = [at[text] for text in ("memory of\none pass", "$y_{m,L}$", "$G$", "$y_L$", "$y_r$")]
    below = [at[text] for text in ("$y_{m,L+1}$", "$H$", "$e_L$")]
    assert above == sorted(above)
    assert below == sorted(below)
    assert max(y for _, y in below) < min(y for _, y in above)


def test_the_position_is_subtracted_and_only_the_position():
    _, ax = rendered(diagrams.draw_learning_loop)
    at = {t.get_text(): np.array(t.get_position()) for t in ax.texts}
    x, y, radius = max(outlines(ax)[1])  # the sum on the right
    np.testing.assert_allclose(at["−"] - (x, y), diagrams._SIGN_SPOTS["w"])
    (wire,) = (
        c.get_xydata()
        for c in ax.lines
        if np.all(c.get_ydata() == y) and c.get_xdata()[0] > at["$G$"][0]
    )
    assert wire[0, 0] < at["$y_L$"][0] < wire[-1, 0] < x - radius  # the rest is its head


# --- the milling machine -------------------------------------------------------------------------


def test_milling_names_every_part_of_the_loop():
    _, ax = rendered(diagrams.draw_milling_setup)
    words = " ".join(t.get_text().replace("\n", " ") for t in ax.texts)
    parts = ("four-flute", "3/8 in", "600 rpm", "runout", "spindle axis", "workpiece", "feed")
    chain = ("dynamometer", "force", "30 Hz", "60 Hz", "computer", "mV", "CNC table")
    assert [part for part in (*parts, *chain) if part not in words] == []


def test_cutter_and_workpiece_do_not_overlap():
    """The edge is what all past positions left, so it cannot enter the circle of the tips."""
    x = np.linspace(*diagrams._PIECE, 2000)
    axis = diagrams._cutter_axis()
    distance = np.hypot(x - axis[0], diagrams._cut_edge(x) - axis[1])
    assert distance.min() == pytest.approx(diagrams._CUTTER, abs=1e-6)
    assert distance.min() >= diagrams._CUTTER - 1e-9


def test_the_drawn_edge_repeats_once_per_turn():
    """A turn behind the cutter, where it no longer cuts; the grid has 200 positions per turn."""
    x = np.linspace(diagrams._SPINDLE[0] + diagrams._TURN, 6.4, 400)
    one_turn_on = diagrams._cut_edge(x + diagrams._TURN)
    np.testing.assert_allclose(diagrams._cut_edge(x), one_turn_on, atol=1e-9)


# --- the lathe -----------------------------------------------------------------------------------


def test_lathe_names_every_part_of_the_loop():
    _, ax = rendered(diagrams.draw_lathe_setup)
    words = " ".join(t.get_text().replace("\n", " ") for t in ax.texts)
    parts = ("workpiece", "tool", "slide", "servo motor", "spindle encoder", "computer", "10 mm")
    signals = (r"angle $\theta$", "command $y_m$", "position $y$", r"$y_r(\theta)$")
    assert [part for part in (*parts, *signals) if part not in words] == []
    assert words.count("encoder") == 2


def test_words_on_the_turned_section_are_readable():
    _, ax = rendered(diagrams.draw_lathe_setup)
    assert min(contrast(t.get_color(), diagrams.STEEL) for t in ax.texts) >= 4.5


def test_the_drawn_radius_is_that_of_the_section_the_chapter_cuts():
    angle = np.linspace(-1.0, 8.0, 500)
    section = lathe.polygon_section(angle, 4, diagrams._INRADIUS)
    np.testing.assert_allclose(diagrams._square_radius(angle), section, rtol=1e-12)


def test_the_tool_touches_the_section_and_does_not_enter_it():
    _, ax = rendered(diagrams.draw_lathe_setup)
    corners = [p.get_xy()[:-1] for p in ax.patches if isinstance(p, Polygon)]
    (square,) = (c for c in corners if np.allclose(np.mean(c, axis=0), diagrams._CENTRE))
    (tool,) = (c for c in corners if len(c) == 4 and np.isclose(c[:, 0].max(), diagrams._SLIDE[0]))
    normal = square[[0, -1]].mean(axis=0) - diagrams._CENTRE  # of the side that faces the tool
    assert np.hypot(*normal) == pytest.approx(diagrams._INRADIUS)
    assert np.degrees(np.arctan2(normal[1], normal[0])) == pytest.approx(-30.0)  # turned clockwise
    depth = (tool - diagrams._CENTRE) @ normal / diagrams._INRADIUS - diagrams._INRADIUS
    assert depth[0] == pytest.approx(0.0, abs=1e-12)
    assert depth[1:].min() > 0.0


def test_the_section_fits_into_its_bar_and_the_bar_into_the_chuck():
    assert np.sqrt(2) * diagrams._INRADIUS < diagrams._BAR < diagrams._CHUCK


def test_the_graph_marks_the_radius_at_the_tool():
    """One turn is the width of the graph; heights run from the inradius to the corner."""
    _, ax = rendered(diagrams.draw_lathe_setup)
    left, right, bottom, top = diagrams._PLOT
    ((x, y, _),) = (c for c in outlines(ax)[1] if left < c[0] < right and c[1] > bottom)
    share = (1 / np.cos(diagrams._ANGLE) - 1) / (np.sqrt(2) - 1)
    assert (x - left) / (right - left) == pytest.approx(30 / 360)
    assert (y - bottom) / (top - bottom) == pytest.approx(share, abs=1e-3)


def test_lathe_wires_end_on_the_blocks_they_feed():
    """Angle and position arrive at the computer, the command at the motor."""
    _, ax = rendered(diagrams.draw_lathe_setup)
    at = {t.get_text(): t.get_position() for t in ax.texts}
    sizes = {(round(x + w / 2, 6), round(y + h / 2, 6)): (w, h) for x, y, w, h in outlines(ax)[0]}
    (x, y), (width, height) = at["computer"], sizes[at["computer"]]
    motor = at["servo\nmotor"]
    below_motor = (motor[0], motor[1] - sizes[motor][1] / 2)
    for tip in ((x - width / 2, y), (x, y - height / 2), below_motor):
        assert sum(np.allclose(head, tip) for head in heads(ax)) == 1


# --- waviness ------------------------------------------------------------------------------------


def profile(eccentricity):
    _, ax = plt.subplots()
    diagrams.draw_waviness(ax, eccentricity, 190e-6, 4.76e-3)
    return ax.lines[0].get_xydata().T


def test_without_runout_every_tooth_leaves_a_scallop():
    """Depth of an arc of radius R and chord f/4: R - sqrt(R^2 - (f/8)^2), drawn in micrometres."""
    _, height = profile(0.0)
    depth = 1e6 * (4.76e-3 - np.sqrt(4.76e-3**2 - (190e-6 / 8) ** 2))
    assert np.ptp(height) == pytest.approx(depth, rel=1e-6)


def test_with_runout_the_longest_tooth_leaves_one_wave_per_turn():
    """The next tooth is 5 um shorter and the wave only 0.95 um high: one tooth in four cuts."""
    x, height = profile(5e-6)
    depth = 1e6 * (4.765e-3 - np.sqrt(4.765e-3**2 - (190e-6 / 2) ** 2))
    assert np.ptp(height) == pytest.approx(depth, rel=1e-6)
    period = int(np.argmin(abs(x - 0.190)))
    np.testing.assert_allclose(height[:-period], height[period:], atol=1e-6)


def test_a_profile_longer_than_the_cutter_is_refused():
    _, ax = plt.subplots()
    with pytest.raises(ValueError, match=r"radius 0.005 m .* draw fewer turns"):
        diagrams.draw_waviness(ax, 0.0, 0.19, 5e-3)


# --- the spindle drive and its loop --------------------------------------------------------------


def test_the_drive_names_every_block_and_signal_once():
    _, ax = rendered(diagrams.draw_spindle_drive)
    words = [t.get_text() for t in ax.texts]
    signals = ("$U_w^*$", "$U_i^*$", "voltage", "$i$", "$w$", r"$T_\mathrm{cut}$", "back EMF")
    parts = ("50 A", "$K_f$", "$C_{w1}$", "$C_{w2}$", "cut $G_d$")
    assert [words.count(s) for s in (*signals, *parts)] == [1] * 12
    assert (words.count("+"), words.count("−")) == (4, 4)


def test_the_drive_runs_right_above_and_left_below():
    _, ax = rendered(diagrams.draw_spindle_drive)
    at = {t.get_text(): t.get_position() for t in ax.texts}
    above = [at[s][0] for s in ("$U_w^*$", "velocity control", "50 A", "$U_i^*$", "voltage")]
    below = [at[s][0] for s in ("armature", "$i$", "$C_{w1}$", "spindle", "$w$")]
    assert above == sorted(above)
    assert below == sorted(below, reverse=True)


def test_only_the_cut_closes_a_dashed_loop():
    _, ax = rendered(diagrams.draw_spindle_drive)
    dashed = [line for line in ax.lines if line.get_linestyle() == "--"]
    cut = next(t for t in ax.texts if t.get_text() == "cut $G_d$").get_position()
    assert len(dashed) == 2
    assert all(np.any(np.isclose(line.get_ydata(), cut[1])) for line in dashed)
    assert len({line.get_color() for line in dashed}) == 2


def test_signs_of_a_sum_fed_from_the_right_and_from_below_stay_apart():
    _, ax = plt.subplots()
    wires = [Wire((2.0, 0.0), "sum"), Wire((0.0, -2.0), "sum")]
    draw_block_diagram(ax, [Sum("sum", signs={"e": "+", "s": "−"})], wires)
    at = {t.get_text(): t.get_position() for t in ax.texts}
    assert at["−"][0] < 0 < at["+"][0]


def test_an_icon_stands_over_the_text_inside_its_block():
    _, ax = plt.subplots()
    draw_block_diagram(ax, [Block("a", "hold", icon=diagrams._HELD, title="title")], [])
    ((left, low, width, height),) = outlines(ax)[0]
    icon = ax.lines[0].get_xydata()
    at = {t.get_text(): t.get_position() for t in ax.texts}
    assert left < icon[:, 0].min() < icon[:, 0].max() < left + width
    assert at["hold"][1] < icon[:, 1].min() < icon[:, 1].max() < low + height < at["title"][1]


@pytest.mark.parametrize("step", ["9°", "3°"])
def test_the_loop_holds_and_samples_at_the_same_step(step):
    _, ax = plt.subplots()
    diagrams.draw_angle_loop(ax, step)
    assert [t.get_text() for t in ax.texts if step in t.get_text()] == [
        f"hold {step}",
        f"sampled\nevery {step}",
    ]


def test_the_loop_learns_before_it_inverts_and_subtracts_only_the_force():
    _, ax = rendered(diagrams.draw_angle_loop)
    at = {t.get_text(): t.get_position()[0] for t in ax.texts}
    chain = [at[s] for s in ("$F_0$", "$L_n$", r"$F(z^{-1})\,z^{-N}$", "$C(z^{-1})$")]
    assert chain == sorted(chain)
    back = [at[s] for s in ("spindle\ndrive", "$w$", "cut", "$F_{ti}$", r"$F_{t\max}$")]
    assert back == sorted(back, reverse=True)
    assert [t.get_text() for t in ax.texts].count("−") == 1


# --- the face mill -------------------------------------------------------------------------------

INSERTS = np.arange(1, 9)


def test_face_mill_names_what_the_model_needs():
    _, ax = rendered(diagrams.draw_face_mill_setup)
    words = " ".join(t.get_text().replace("\n", " ") for t in ax.texts)
    parts = ("spindle axis", "cutter centre", "runout", "workpiece", "entry, 0°", "exit, 180°")
    signals = (
        "$w$",
        "$v_0$",
        "$F_t$",
        r"$\theta_i$",
        r"$\Delta\theta$",
        r"f_t\,\sin\theta_i+\Delta_i",
    )
    assert [part for part in (*parts, *signals) if part not in words] == []


def test_inserts_are_numbered_against_the_rotation():
    """The angle of insert i is that of the cutter minus i - 1 pitches, clockwise."""
    _, ax = rendered(diagrams.draw_face_mill_setup)
    at = {t.get_text(): np.subtract(t.get_position(), diagrams._AXIS) for t in ax.texts}
    x, y = np.array([at[str(i)] for i in INSERTS]).T
    step = np.diff(np.unwrap(np.arctan2(x, y)))
    assert np.degrees(step) == pytest.approx([-45.0] * 7, abs=5.0)


def test_runout_is_that_of_the_paper_in_proportion_to_the_feed():
    mill = face_mill.EIGHT_TEETH
    reach = np.array([diagrams._tooth_reach(i) for i in INSERTS])
    drawn = (reach - np.roll(reach, 1)) / diagrams._TOOTH_FEED
    np.testing.assert_allclose(drawn, np.array(mill.runout) / mill.tooth_feed, rtol=1e-3)
    enlarged = diagrams._TOOTH_FEED / mill.tooth_feed * mill.diameter / 2 / diagrams._REACH
    assert enlarged == pytest.approx(200, rel=0.05)


def test_half_of_the_inserts_touch_the_front_and_none_enters_it():
    angle = np.array([diagrams._tooth_angle(i) for i in INSERTS]) % (2 * np.pi)
    reach = np.array([diagrams._tooth_reach(i) for i in INSERTS])
    cutting = angle < np.pi
    assert INSERTS[cutting].tolist() == [1, 2, 3, 8]
    behind = diagrams._front(angle[cutting] - 1e-3)
    np.testing.assert_allclose(behind, reach[cutting], atol=2e-3)
    assert np.all(diagrams._front(angle[cutting] + 1e-3) < reach[cutting])  # the chip ahead of it


def test_the_drawn_chip_is_about_as_thick_as_the_label_says():
    """The model takes circles for the paths; the drawing, whose feed is large, the paths."""
    angle = diagrams._STANDS
    own, last = (float(diagrams._tooth_path(i, np.array(angle))) for i in (2, 1))
    runout = diagrams._tooth_reach(2) - diagrams._tooth_reach(1)
    assert own == pytest.approx(diagrams._tooth_reach(2), abs=1e-6)
    expected = diagrams._TOOTH_FEED * np.sin(angle) + runout
    assert own - last == pytest.approx(expected, rel=0.1)


# --- boring at a varying speed -------------------------------------------------------------------


def test_boring_names_every_part_of_the_loop():
    _, ax = rendered(diagrams.draw_boring_setup)
    words = " ".join(t.get_text().replace("\n", " ") for t in ax.texts)
    parts = ("encoder", "chuck", "workpiece", "boring bar", "piezo", "holder", "feed", "46 µm")
    signals = ("240 samples", r"$\Delta\theta$ = 1.5°", "$v(k)$", "$y(k)$", "$y$", r"$\theta$")
    chain = ("computer", "amplifier", r"\omega_0\,[1+\mathrm{RVA}", r"$\omega$")
    assert [part for part in (*parts, *signals, *chain) if part not in words] == []


@pytest.mark.parametrize(("samples", "step"), [(240, "1.5°"), (360, "1°")])
def test_the_trigger_angle_belongs_to_the_samples_of_a_turn(samples, step):
    _, ax = plt.subplots()
    diagrams.draw_boring_setup(ax, samples)
    words = [t.get_text() for t in ax.texts]
    assert f"{samples} samples a turn" in words
    assert any(w.endswith(f"= {step}") for w in words)


def tools(ax):
    dark = [p for p in ax.patches if isinstance(p, Polygon) and p.get_facecolor()[0] < 0.5]
    return [p.get_xy()[:-1] for p in dark if len(p.get_xy()) == 5]


def test_the_tool_is_at_the_wall_of_the_bore_in_both_views():
    _, ax = rendered(diagrams.draw_boring_setup)
    side, end = sorted(tools(ax), key=lambda xy: xy[:, 0].min())
    wall = diagrams._LEVEL + float(diagrams._bore_radius(0.0))
    assert side[:, 1].max() == end[:, 1].max() == pytest.approx(wall)
    assert side[np.argmax(side[:, 1]), 0] == diagrams._EDGE
    offset = end - diagrams._END
    turn = np.arctan2(*offset.T)
    assert np.all(np.hypot(*offset.T) <= diagrams._bore_radius(turn) + 1e-9)


def test_the_bar_fits_into_the_bore_and_the_bore_into_the_pipe():
    radius = diagrams._bore_radius(np.linspace(0, 2 * np.pi, 361))
    assert diagrams._ROD < diagrams._ROUGH < radius.min()
    assert radius.max() < diagrams._PIPE < diagrams._JAWS
    mean, oval = diagrams._BORE, diagrams._OVAL
    assert (radius.min(), radius.max()) == pytest.approx((mean - oval, mean + oval), rel=1e-3)


def test_samples_lie_on_the_bore_at_equal_angles_one_at_the_mark_and_one_at_the_tool():
    _, ax = rendered(diagrams.draw_boring_setup)
    dots = np.array([c[:2] for c in outlines(ax)[1] if c[2] == 0.055]) - diagrams._END
    angle = np.arctan2(*dots.T)
    np.testing.assert_allclose(np.hypot(*dots.T), diagrams._bore_radius(angle), rtol=1e-12)
    np.testing.assert_allclose(np.diff(np.sort(angle)), 2 * np.pi / diagrams._DOTS, rtol=1e-9)
    for at in (0.0, diagrams._TURNED):
        assert np.abs(angle - at).min() < 1e-12


def test_boring_wires_end_on_the_blocks_they_feed():
    _, ax = rendered(diagrams.draw_boring_setup)
    at = {t.get_text(): t.get_position() for t in ax.texts}
    sizes = {(round(x + w / 2, 6), round(y + h / 2, 6)): (w, h) for x, y, w, h in outlines(ax)[0]}
    (x, y), (width, height) = at["computer"], sizes[at["computer"]]
    amplifier = at["amplifier"]
    into_amplifier = (amplifier[0] - sizes[amplifier][0] / 2, amplifier[1])
    into_holder = (amplifier[0], at["holder"][1] - sizes[at["holder"]][1] / 2)
    for tip in ((x - width / 2, y), (x, y + height / 2), into_amplifier, into_holder):
        assert sum(np.allclose(head, tip) for head in heads(ax)) == 1
    assert abs(into_holder[0] - at["holder"][0]) < sizes[at["holder"]][0] / 2


def test_the_strip_shows_the_intervals_of_the_speed_law():
    """One turn per period of the speed, at a mean of 2 pi rad/s, so that the period is 1 s."""
    angle, time = diagrams._sampling_instants()
    n = diagrams._STEPS

    def speed(t):
        return boring_bar.relative_speed_law(t, 2 * np.pi, diagrams._SWING, 1.0)

    expected = boring_bar.angle_triggered_intervals(speed, 2 * np.pi / n, n)
    np.testing.assert_allclose(np.diff(angle), 1 / n)
    np.testing.assert_allclose(np.diff(time), expected, atol=1e-5)


def test_lines_of_the_strip_join_equal_steps_to_the_instants_of_the_speed_samples():
    _, ax = rendered(diagrams.draw_periodic_sampling)
    levels = (diagrams._ANGLES, diagrams._TIMES)
    joined = [c.get_xdata() for c in ax.lines if tuple(c.get_ydata()) == levels]
    above, below = np.sort(np.array(joined).T)
    assert len(above) == diagrams._STEPS + 1
    np.testing.assert_allclose(np.diff(above), np.diff(above)[0])
    dots = sorted(x for x, _, _ in outlines(ax)[1])
    np.testing.assert_allclose(dots, below)
    gaps, at = np.diff(below), {t.get_text(): t.get_position()[0] for t in ax.texts}
    for word, k in (("short $T(k)$", np.argmin(gaps)), ("long $T(k)$", np.argmax(gaps))):
        assert below[k] < at[word] < below[k + 1]


def test_the_periodic_loop_names_every_signal_once_and_subtracts_only_the_output():
    _, ax = rendered(diagrams.draw_periodic_loop)
    words = [t.get_text() for t in ax.texts]
    signals = [f"${s}(k)$" for s in "rewuvy"] + ["$v(t)$", "$y(t)$"]
    blocks = ["$Q\\,q^{-(N-L)}$", "$q^{-L}$", "$G_c(k)$", "$G(s)$", "hold $T(k)$"]
    assert [words.count(s) for s in (*signals, *blocks)] == [1] * 13
    assert (words.count("+"), words.count("−")) == (3, 1)


def test_the_periodic_loop_runs_right_above_and_left_below():
    _, ax = rendered(diagrams.draw_periodic_loop)
    at = {t.get_text(): t.get_position() for t in ax.texts}
    above = [at[f"${s}(k)$"][0] for s in "rewuv"]
    below = [at[s][0] for s in ("hold $T(k)$", "$v(t)$", "$G(s)$", "$y(t)$", "$y(k)$")]
    assert above == sorted(above)
    assert below == sorted(below, reverse=True)
    x, y, _ = min(outlines(ax)[1], key=lambda c: (c[2] < 0.2, c[0]))  # the left sum
    np.testing.assert_allclose(np.subtract(at["−"], (x, y)), diagrams._SIGN_SPOTS["s"])


# --- regenerative chatter ------------------------------------------------------------------------


def test_regeneration_names_the_oscillator_and_the_chip():
    _, ax = rendered(diagrams.draw_regeneration)
    words = " ".join(t.get_text().replace("\n", " ") for t in ax.texts)
    oscillator = ("mass $m$", "$k$", "$c$", "$x$", "tool", "workpiece", "phase shift", "chip")
    law = ("$h(t)=h_0+x(t-\\tau)-x(t)$", "$h(t)$", "$h_0$", "$x(t-\\tau)$", "$x(t)$", "$K\\,h(t)$")
    assert [part for part in (*oscillator, *law) if part not in words] == []


def test_the_chip_is_measured_at_the_edge_of_the_tool_from_one_surface_to_the_other():
    _, ax = rendered(diagrams.draw_regeneration)
    tip = diagrams._TIP
    low, high = float(diagrams._cut_surface(tip)), float(diagrams._last_surface(tip))
    (label,) = (t for t in ax.texts if t.get_text() == "$h(t)$")
    ends = [y for x, y in heads(ax) if abs(x - label.get_position()[0]) < 0.8 and 1.5 < y < 4.0]
    assert sorted(ends) == pytest.approx([low, high])
    (tool,) = tools(ax)
    assert tuple(tool[np.argmin(tool[:, 1])]) == pytest.approx((tip, low))


def test_the_tool_always_cuts_and_has_just_the_marks_of_its_own_path_behind_it():
    _, ax = rendered(diagrams.draw_regeneration)
    x = np.linspace(*diagrams._CUT_PIECE[:2], 2000)
    assert np.all(diagrams._last_surface(x) > diagrams._cut_surface(x))
    (tool,) = tools(ax)
    edge = np.linspace(tool[0], tool[-1], 50)[1:]  # its relief, from the tip
    assert np.all(edge[:, 1] > diagrams._cut_surface(edge[:, 0]))


def test_the_drawn_lag_is_one_at_which_the_last_wave_feeds_the_vibration():
    """Work per cycle of the force K x(t - tau), which pushes the tool out of the cut."""
    cycle = np.linspace(0, diagrams._WAVE, 400, endpoint=False)
    x = diagrams._cut_surface(diagrams._TIP - cycle)  # time goes on to the left
    before = diagrams._last_surface(diagrams._TIP - cycle)
    assert np.sum(before * np.gradient(x)) > 0


# --- teeth and chips -----------------------------------------------------------------------------


def test_a_tooth_has_a_bar_of_its_value_and_follows_anticlockwise():
    _, ax = plt.subplots(subplot_kw={"projection": "polar"})
    assert plot.draw_teeth(ax, [3.0, 5.0, 4.0], 4.0, "before") is ax
    bars = ax.patches
    assert [bar.get_height() for bar in bars] == [3.0, 5.0, 4.0]
    middle = [bar.get_x() + bar.get_width() / 2 for bar in bars]
    assert middle == pytest.approx([0, 2 * np.pi / 3, 4 * np.pi / 3])
    assert (ax.get_theta_offset(), ax.get_theta_direction()) == (np.pi / 2, 1)
    assert [t.get_text() for t in ax.get_xticklabels()] == ["1", "2", "3"]
    assert np.all(ax.lines[-1].get_ydata() == 4.0)


def test_a_second_set_of_bars_leaves_the_first_to_be_seen():
    _, ax = plt.subplots(subplot_kw={"projection": "polar"})
    plot.draw_teeth(ax, np.full(8, 2.0), 1.0, "before")
    plot.draw_teeth(ax, np.full(8, 1.0), 1.0, "after", outlined=True)
    before, after = ax.patches[0], ax.patches[8]
    assert before.get_fill()
    assert not after.get_fill()
    assert after.get_width() < before.get_width()
    labels = ax.get_legend_handles_labels()[1]
    assert sorted(labels) == ["after", "before", "nominal, 1 N"]
    assert ax.get_ylim()[0] == 0.0


def chips(ax):
    return [p.get_xy() for p in ax.patches if isinstance(p, Polygon)]


def test_a_chip_is_as_long_as_its_thickness_magnified_and_where_its_tooth_is():
    _, ax = plt.subplots()
    angle, thickness = np.radians([90.0, 45.0, 0.0, -45.0]), np.array([60e-6, 30e-6, 0.0, 0.0])
    assert plot.draw_cutter_chips(ax, angle, thickness, 0.05, 200) is ax
    assert len(chips(ax)) == 2
    for xy, at, chip in zip(chips(ax), angle, thickness, strict=False):
        distance = np.hypot(*xy.T)
        assert np.ptp(distance) == pytest.approx(200 * chip)
        assert distance.min() == pytest.approx(0.05)
        assert np.arctan2(*xy[:-1].mean(axis=0)) == pytest.approx(at)  # clockwise from the top
    assert [t.get_text() for t in ax.texts] == ["200×", "1", "2", "3", "4"]


def test_cutters_with_the_same_feed_share_their_scale():
    _, axes = plt.subplots(1, 2)
    for ax, chip in zip(axes, (20e-6, 70e-6), strict=True):
        plot.draw_cutter_chips(ax, [np.pi / 2], [chip], 0.05, 200, feed=60e-6, numbered=False)
        assert [t.get_text() for t in ax.texts] == ["200×"]
        assert ax.lines[0].get_xdata().max() == pytest.approx(0.05 + 200 * 60e-6)
    assert axes[0].get_xlim() == axes[1].get_xlim()
    assert axes[0].get_ylim() == axes[1].get_ylim()


# --- a bore --------------------------------------------------------------------------------------

ANGLE = 2 * np.pi * np.arange(480) / 240  # two turns
ELLIPSE = 23e-6 * np.sin(2 * ANGLE)


def bore(*calls, **kwargs):
    _, ax = plt.subplots(subplot_kw={"projection": "polar"})
    for call in calls:
        assert plot.draw_bore(ax, ANGLE, ELLIPSE, *call, **kwargs) is ax
    ax.get_figure().draw_without_rendering()
    return ax


def test_a_bore_is_what_is_desired_less_the_magnified_error_in_micrometres():
    ax = bore((4e-6 * np.cos(ANGLE), 2, "cut"))
    circle, desired, cut = ax.lines
    assert np.all(circle.get_ydata() == 0)
    np.testing.assert_allclose(desired.get_ydata()[:-1], 1e6 * ELLIPSE)
    drawn = 1e6 * ELLIPSE - 8 * np.cos(ANGLE)
    np.testing.assert_allclose(cut.get_ydata(), [*drawn, drawn[0]])  # closed
    assert ax.get_rmax() >= np.abs(drawn).max()
    assert ax.get_rmin() == -ax.get_rmax()
    assert [t.get_text() for t in ax.texts] == ["rings\n±20 µm\nerror 2×"]


def test_a_second_cut_repeats_neither_profile_nor_words_and_is_not_clipped():
    ax = bore((0 * ANGLE, 1, "good"), (30e-6 * np.sin(ANGLE), 1, "bad"))
    assert ax.get_legend_handles_labels()[1] == ["desired", "good", "bad"]
    assert len(ax.lines) == 4
    assert [t.get_text() for t in ax.texts] == ["rings\n±20 µm"]
    assert ax.get_rmax() >= 53
    assert len({c.get_linestyle() for c in ax.lines[2:]}) == 2


def test_bores_with_the_same_reach_share_their_scale():
    one, other = (bore((e * np.sin(ANGLE), 1), reach=35e-6) for e in (1e-6, 5e-6))
    assert one.get_rmax() == other.get_rmax() == pytest.approx(35)
    assert one.get_rorigin() == other.get_rorigin()


# --- the style -----------------------------------------------------------------------------------


def test_curves_of_the_cycle_differ_in_colour_and_neighbours_in_line_style():
    cycle = list(plt.rcParams["axes.prop_cycle"])
    assert len({c["color"] for c in cycle}) == len(cycle)
    assert len({c["linestyle"] for c in cycle[:4]}) == 4
    assert all(a["linestyle"] != b["linestyle"] for a, b in pairwise(cycle))


def test_the_first_four_curves_stand_out_from_white_paper():
    """3:1 is the accessibility guidelines' threshold for graphics (WCAG 2.1, 1.4.11)."""
    cycle = list(plt.rcParams["axes.prop_cycle"])
    assert min(contrast(c["color"], "white") for c in cycle[:4]) >= 3.0


def test_fonts_are_those_that_ship_with_matplotlib():
    assert plt.rcParams["font.sans-serif"] == ["DejaVu Sans"]
    assert plt.rcParams["mathtext.fontset"] == "dejavusans"


@pytest.mark.parametrize("draw", [LAYOUTS[name] for name in sorted(MACHINES)])
def test_the_same_drawing_gives_the_same_file(tmp_path, draw):
    for name in ("first.svg", "second.svg"):
        figure, _ = rendered.__wrapped__(draw)
        figure.savefig(tmp_path / name, metadata={"Date": None})
    assert (tmp_path / "first.svg").read_bytes() == (tmp_path / "second.svg").read_bytes()


def test_blocks_grow_with_their_text():
    _, ax = plt.subplots()
    fraction = r"$\dfrac{z^{-d}\,Q(z^{-1})}{P(z^{-1})}$"
    items = [Block("a", "PI"), Block("b", "repetitive controller", (4, 0)), Block("c", fraction)]
    draw_block_diagram(ax, items, [])
    (_, _, a, low), (_, _, b, _), (_, _, _, high) = outlines(ax)[0]
    assert a < b
    assert low < high
