"""The pictures: what a wire may say, that text stays readable, that grey print loses nothing."""

from collections import Counter
from dataclasses import replace
from functools import partial
from itertools import combinations, pairwise

import matplotlib

matplotlib.use("Agg")

import layouts
import matplotlib.pyplot as plt
import numpy as np
import pytest
from layouts import contrast, outlines, rendered
from matplotlib.patches import Polygon

from rcbook import pictures
from rcbook.machines import face_mill
from rcbook.machines.peripheral_mill import HORNG1989
from rcbook.pictures import Block, Frame, Node, Sketch, Sum, Wire, blocks, draw_block_diagram, path
from rcbook.pictures import boring_bar as boring
from rcbook.pictures import chatter as regeneration
from rcbook.pictures import face_mill as facing
from rcbook.pictures import lathe as turning
from rcbook.pictures import peripheral_mill as milling
from rcbook.pictures import sketch as pen

LAYOUTS = layouts.discover()


@pytest.fixture(autouse=True)
def house_style():
    with plt.style.context(layouts.STYLE):
        yield
    plt.close("all")


def heads(ax):
    """Tips of the arrow heads: triangles whose first corner is the tip."""
    found = [p.get_xy() for p in ax.patches if isinstance(p, Polygon) and len(p.get_xy()) == 4]
    return [xy[0] for xy in found]


def words(ax):
    return [text.get_text() for text in ax.texts]


def places(ax):
    return {text.get_text(): text.get_position() for text in ax.texts}


def missing(draw, *parts):
    """Those of the `parts` that no text of a drawing holds."""
    text = " ".join(words(rendered(draw)[1])).replace("\n", " ")
    return [part for part in parts if part not in text]


def keeps_the_rules(draw):
    for rule in layouts.RULES:
        rule(rendered(draw)[1])


# --- the rules, for every drawing ----------------------------------------------------------------


@pytest.mark.parametrize("size", layouts.SIZES, ids=str)
@pytest.mark.parametrize("rule", layouts.RULES, ids=lambda rule: rule.__name__)
@pytest.mark.parametrize("name", LAYOUTS)
def test_every_drawing_keeps_the_rules(name, rule, size):
    rule(rendered(LAYOUTS[name], size)[1])


@pytest.mark.parametrize("name", LAYOUTS)
def test_text_on_a_phone_has_at_least_eight_pixels(name):
    """390 pixels wide, drawn for 8 inches: 8 px is what the smallest system fonts use."""
    _, ax = rendered(LAYOUTS[name])
    assert min(t.get_fontsize() for t in ax.texts) / 72 * 390 / layouts.PHONE[0] >= 8.0


@pytest.mark.parametrize("name", LAYOUTS)
def test_the_same_drawing_gives_the_same_file(tmp_path, name):
    for file in ("first.svg", "second.svg"):
        figure, _ = rendered.__wrapped__(LAYOUTS[name])
        figure.savefig(tmp_path / file, metadata={"Date": None})
    assert (tmp_path / "first.svg").read_bytes() == (tmp_path / "second.svg").read_bytes()


def test_there_are_drawings_of_loops_and_of_every_machine():
    assert len({name.split(",")[0] for name in LAYOUTS}) >= 12
    assert {name.split("_")[-1] for name in LAYOUTS} >= {"setup", "loop", "drive", "regeneration"}


# --- and that they catch what they should ---------------------------------------------------------


def box(ax, wires=(), more=(), write=()):
    """Two boxes and a wire between them, with a fault or two."""
    draw_block_diagram(ax, [Block("a", "one"), Block("b", "two", (4, 0)), *more], wires)
    for text, x, y in write:
        ax.text(x, y, text)
    return ax


def shade(ax, color):
    box(ax, [Wire("a", "b", "$u$")])
    ax.texts[0].set_color(color)
    return ax


def slant(ax):
    box(ax, [Wire("a", "b")])
    ax.plot([0.5, 3], [0.1, 0.4], gid="wire")
    return ax


def stray(ax):
    box(ax)
    ax.text(9.2, 0, "far").set_in_layout(False)  # else the axes make room for it
    return ax


STRAIGHT = Wire("a", "b", "$u$")
INSIDE, GROUND, PALE, SLANTED, CROSSING, ENDS = layouts.RULES
FAULTS = {
    "a text below the figure": (INSIDE, {"write": [("far", 0, -9)]}),
    "a text on a text": (INSIDE, {"write": [("three", 0, 0)]}),
    "a wire through a text": (GROUND, {"wires": [STRAIGHT], "write": [("three", 1.7, -0.1)]}),
    "a text half in a block": (GROUND, {"write": [("three", 3.1, 0.1)]}),
    "a text on an arrow head": (GROUND, {"wires": [STRAIGHT], "write": [("x", 3.25, 0)]}),
    "two wires that cross": (CROSSING, {"wires": [STRAIGHT, Wire((2, 2), (2, -2), "$w$")]}),
    "a wire that ends between two blocks": (ENDS, {"wires": [Wire("a", (2, 0), "$u$")]}),
    "two wires that end nowhere": (ENDS, {"wires": [Wire("a", (0, 3)), Wire("b", (4, 3))]}),
    "an input without a name": (ENDS, {"wires": [Wire((0, 3), "a")]}),
    "a branch without a dot": (
        ENDS,
        {"wires": [Wire("a", "b"), Wire((2, 0), "s", via=2)], "more": [Sum("s", (4, 2))]},
    ),
}
DRAWN_FAULTS = {name: (rule, partial(box, **fault)) for name, (rule, fault) in FAULTS.items()}
DRAWN_FAULTS["a text that leaves the figure"] = INSIDE, stray
DRAWN_FAULTS["a slanted wire"] = SLANTED, slant
DRAWN_FAULTS["a pale text"] = PALE, partial(shade, color="0.5")


@pytest.mark.parametrize("name", DRAWN_FAULTS)
def test_a_planted_fault_is_caught(name):
    rule, draw = DRAWN_FAULTS[name]
    _, ax = rendered(draw)
    with pytest.raises(AssertionError):
        rule(ax)


def test_a_diagram_without_a_fault_passes():
    keeps_the_rules(partial(box, wires=[STRAIGHT, Wire((0, 2), "a", "$r$")]))


def test_a_new_module_is_found_and_handed_on_without_being_listed(tmp_path, monkeypatch):
    source = (
        "def draw_planted(ax, word=''):\n    return ax\n\ndef draw_part(ax, needed):\n    pass\n"
    )
    (tmp_path / "planted.py").write_text(source, encoding="utf-8")
    monkeypatch.setattr(pictures, "__path__", [*pictures.__path__, str(tmp_path)])
    found = layouts.discover()
    assert found.keys() - LAYOUTS.keys() == {"draw_planted", "draw_planted, all texts"}
    assert pictures.drawings(pictures.__path__).keys() >= {"draw_planted", "draw_cut", "draw_bore"}
    with pytest.raises(AssertionError, match="returns its axes"):
        rendered(lambda ax: None)


def test_a_drawing_is_tried_with_every_parameter_set_of_its_machine(monkeypatch):
    other = replace(face_mill.TSAO_PONG1991, feed_per_turn=0.4e-3)
    monkeypatch.setattr(face_mill, "ANOTHER2030", other, raising=False)
    found = layouts.discover().keys() - LAYOUTS.keys()
    assert found == {"draw_angle_loop, ANOTHER2030", "draw_face_mill_setup, ANOTHER2030"}


# --- what a diagram refuses ----------------------------------------------------------------------


PI, SUM = Block("pi", "PI"), Sum("sum", (3, 0))
REFUSED = {
    "two items are named 'pi': give every item its own": ([PI, Node("pi", (2, 0))], []),
    "'plnat', which is not drawn: use one of 'pi', 'sum'": ([PI, SUM], [Wire("pi", "plnat")]),
    "'pnat', which is not drawn: use one of 'pi', 'sum'": ([PI, SUM], [Wire("pnat", "pi")]),
    "'sum' from side 'n', which has no sign: add 'n'": ([SUM], [Wire((3.0, 2.0), "sum")]),
    "'pi' to 'pi' has no length": ([PI], [Wire("pi", "pi")]),
}


@pytest.mark.parametrize("words", REFUSED)
def test_what_cannot_be_drawn_is_named_with_its_mend_and_leaves_no_ink(words):
    _, ax = plt.subplots()
    with pytest.raises(ValueError, match=words):
        draw_block_diagram(ax, *REFUSED[words])
    assert not ax.patches
    assert not ax.texts


# --- where wires end -----------------------------------------------------------------------------


def test_arrow_tips_lie_on_the_outlines_they_point_at():
    _, ax = plt.subplots()
    items = [
        Block("box", "box", (0, 0), width=2.0, height=1.0),
        Sum("sum", (4, 0), signs={"w": "+", "n": "−"}),
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


# --- what a reader sees --------------------------------------------------------------------------


def test_fills_differ_in_grey():
    """Outlines do the work; the tints of machine and controller only must not fall together."""
    for one, other in combinations((pen.PAPER, pen.PLANT, pen.FOCUS), 2):
        assert contrast(one, other) > 1.15
    assert contrast(pen.PLANT, pen.STEEL) > 1.15  # a turned section on its bar


def test_a_drawing_keeps_its_scale_when_the_figure_is_large():
    _, small = rendered(pictures.draw_feedback_loop, (8.0, 4.0))
    _, large = rendered(pictures.draw_feedback_loop, (16.0, 8.0))
    assert {t.get_fontsize() for t in small.texts} == {t.get_fontsize() for t in large.texts}


def test_text_and_drawing_shrink_together():
    sizes = {}
    for width in (4.0, 2.0):
        figure, ax = rendered(pictures.draw_feedback_loop, (width, width / 2))
        unit = np.ptp(ax.transData.transform([(0, 0), (1, 0)])[:, 0])
        sizes[width] = ax.texts[0].get_fontsize() * figure.dpi / unit
    assert sizes[4.0] == pytest.approx(sizes[2.0], rel=1e-6)


def test_blocks_grow_with_their_text():
    _, ax = plt.subplots()
    fraction = r"$\dfrac{z^{-d}\,Q(z^{-1})}{P(z^{-1})}$"
    items = [Block("a", "PI"), Block("b", "repetitive controller", (4, 0)), Block("c", fraction)]
    draw_block_diagram(ax, items, [])
    (_, _, a, low), (_, _, b, _), (_, _, _, high) = outlines(ax)[0]
    assert a < b
    assert low < high


def test_texts_may_be_long():
    signals = (r"$F_\mathrm{ref}$", "force error", "feed command $V$", "$F$")
    plant = r"$\dfrac{z^{-d}\,Q(z^{-1})}{P(z^{-1})}$"
    parts = ("repetitive\ncontroller", plant)
    texts = {"parts": parts, "signals": signals, "disturbance": "runout"}
    keeps_the_rules(partial(pictures.draw_feedback_loop, **texts))


def test_signs_of_a_sum_fed_from_the_right_and_from_below_stay_apart():
    _, ax = plt.subplots()
    wires = [Wire((2.0, 0.0), "sum"), Wire((0.0, -2.0), "sum")]
    draw_block_diagram(ax, [Sum("sum", signs={"e": "+", "s": "−"})], wires)
    assert places(ax)["−"][0] < 0 < places(ax)["+"][0]


def test_an_icon_stands_over_the_text_inside_its_block():
    _, ax = plt.subplots()
    draw_block_diagram(ax, [Block("a", "hold", icon=blocks.HELD, title="title")], [])
    ((left, low, width, height),), at = outlines(ax)[0], places(ax)
    icon = ax.lines[0].get_xydata()
    assert left < icon[:, 0].min() < icon[:, 0].max() < left + width
    assert at["hold"][1] < icon[:, 1].min() < icon[:, 1].max() < low + height < at["title"][1]


def test_a_path_is_a_wire_between_every_two_ends():
    assert path("a", "$u$", "b", "", (3, 0)) == [Wire("a", "b", "$u$"), Wire("b", (3, 0))]
    with pytest.raises(ValueError, match="zip"):
        path("a", "$u$", "b", "$y$")


def test_a_line_from_words_begins_at_their_border_and_ends_at_what_they_name():
    _, ax = plt.subplots()
    Sketch(ax).write("workpiece", 4.0, 2.0, "left", (9.0, 2.0))
    (line,) = ax.lines
    start, end = line.get_xydata()
    assert tuple(end) == (9.0, 2.0)
    assert start == pytest.approx((4.1 + pen.text_size("workpiece")[0] * 1.08, 2.0))


# --- loops ---------------------------------------------------------------------------------------


def runs(draw, above, below):
    """Signals run to the right above and back to the left below."""
    at = places(rendered(draw)[1])
    right, left = [at[text][0] for text in above], [at[text][0] for text in below]
    assert right == sorted(right)
    assert left == sorted(left, reverse=True)
    assert all(at[one][1] > at[other][1] for one in above for other in below)


def counts(draw, *texts):
    """How often each text is on a drawing."""
    found = words(rendered(draw)[1])
    return [found.count(text) for text in texts]


def test_a_loop_has_its_texts_in_order_and_subtracts_only_the_output():
    parts, signals = ("PI", "milling"), ("$r$", "$e$", "$u$", "$F$")
    draw = partial(pictures.draw_feedback_loop, parts=parts, signals=signals)
    runs(draw, ("$r$", "$e$", "PI", "$u$", "milling", "$F$"), ())
    assert counts(draw, "+", "−") == [1, 1]


def test_loops_nest_and_each_controller_has_its_own_error():
    parts, signals = ("$G_r$", "PI", "milling"), ("$r$", "$e$", "$v$", "$d$", "$u$", "$F$")
    texts = {"disturbance": "$w$", "inner_loop": "closed loop", "focus": True}
    draw = partial(pictures.draw_feedback_loop, parts=parts, signals=signals, **texts)
    runs(draw, ("$r$", "$e$", "$G_r$", "$v$", "$d$", "PI", "$u$", "$w$", "milling", "$F$"), ())
    assert counts(draw, "+", "−", "closed loop") == [4, 2, 1]
    keeps_the_rules(draw)


def test_a_loop_with_a_signal_too_few_is_refused():
    _, ax = plt.subplots()
    with pytest.raises(ValueError, match="3 parts have 6 signals: not 4"):
        pictures.draw_feedback_loop(ax, ("outer", "inner", "plant"))


# Above to the right, below to the left: every text where its signal is; then every other text, and
# how many signs there are.
ROUND = {
    pictures.draw_learning_loop: (
        ["memory of\none pass", "$v_m$", "$G$", "$y_m$", "$r$"],
        ["$e_m$", "$C$", "$v_{m+1}$"],
        ["+"] * 3 + ["−"],
    ),
    pictures.draw_spindle_drive: (
        ["$v$", "velocity control", "50 A", "$U_i^*$", "voltage"],
        ["armature", "$i$", "$C_{w1}$", "spindle", r"$\Omega$"],
        ["+", "−"] * 4 + [r"$T_\mathrm{cut}$", "back EMF", "$K_f$", "$C_{w2}$", "cut $G_d$"],
    ),
    pictures.draw_angle_loop: (
        ["$r$", "$e$", "$k_r$", r"$q\,z^{-N}$", "$C$", "$u$", "$v$"],
        ["spindle\ndrive", r"$\Omega$", "cut", "$F_i$", "$y$"],
        ["−"],
    ),
    pictures.draw_periodic_loop: (
        [f"${s}(k)$" for s in "reuv"],
        ["hold $T(k)$", "$v(t)$", "$G(s)$", "$y(t)$", "$y(k)$"],
        ["+"] * 3 + ["−", r"$q\,z^{-(N-L)}$", "$z^{-L}$", "$C(k)$"],
    ),
}


@pytest.mark.parametrize("draw", ROUND)
def test_signals_go_round_and_everything_is_named_once(draw):
    above, below, others = ROUND[draw]
    runs(draw, above, below)
    found = Counter(words(rendered(draw)[1]))
    expected = Counter([*above, *below, *others])
    assert {text: found[text] for text in expected} == expected


def minus(draw, side):
    """The sum that subtracts at this side of it."""
    _, ax = rendered(draw)
    at = np.subtract(places(ax)["−"], blocks.SIGN_SPOTS[side])
    (found,) = (c for c in outlines(ax)[1] if np.allclose(c[:2], at))
    return found


def test_the_position_is_subtracted_where_its_wire_enters():
    _, ax = rendered(pictures.draw_learning_loop)
    x, y, radius = minus(pictures.draw_learning_loop, "w")
    (wire,) = (w for w in layouts.wires(ax) if np.allclose(w[-1], (x - radius, y)))
    assert wire[0, 0] < places(ax)["$y_m$"][0] < wire[-1, 0]


def test_the_output_of_the_periodic_loop_is_subtracted_on_the_left():
    _, ax = rendered(pictures.draw_periodic_loop)
    sums = [c for c in outlines(ax)[1] if c[2] > 0.2]
    assert minus(pictures.draw_periodic_loop, "s") == min(sums)


def test_only_the_cut_closes_a_dashed_loop():
    _, ax = rendered(pictures.draw_spindle_drive)
    dashed = [line for line in ax.lines if line.get_linestyle() == "--"]
    assert len(dashed) == 2
    assert all(np.any(np.isclose(c.get_ydata(), places(ax)["cut $G_d$"][1])) for c in dashed)
    assert len({line.get_color() for line in dashed}) == 2


@pytest.mark.parametrize(("samples", "step"), [(5, "9°"), (15, "3°")])
def test_the_loop_holds_and_samples_at_the_step_of_the_machine(samples, step):
    _, ax = plt.subplots()
    pictures.draw_angle_loop(ax, replace(face_mill.TSAO_PONG1991, samples_per_pitch=samples))
    assert [t for t in words(ax) if step in t] == [f"hold {step}", f"sampled\nevery {step}"]


# --- the milling machine -------------------------------------------------------------------------


def test_the_words_on_the_milling_machine_are_those_of_the_machine():
    plant = replace(HORNG1989.plant, dt=0.02)
    other = {"flutes": 3, "cutter_diameter": 12.7e-3, "spindle_frequency": 5.0}
    mill = replace(HORNG1989, plant=plant, filter_corner=20.0, **other)
    parts = ("three-flute", "1/2 in", "300 rpm", "20 Hz", "50 Hz")
    assert missing(partial(pictures.draw_milling_setup, mill=mill), *parts) == []


def test_cutter_and_workpiece_do_not_overlap():
    """The edge is what all past positions left, so it cannot enter the circle of the tips."""
    x = np.linspace(*milling.PIECE, 2000)
    axis = milling.cutter_axis(0.0)
    distance = np.hypot(x - axis[0], milling.cut_edge(x) - axis[1])
    assert distance.min() == pytest.approx(milling.RADIUS, abs=1e-6)
    assert distance.min() >= milling.RADIUS - 1e-9


def test_the_drawn_edge_repeats_once_per_turn():
    """A turn behind the cutter, where it no longer cuts; the grid has 200 positions per turn."""
    x = np.linspace(milling.SPINDLE[0] + milling.TURN, 6.4, 400)
    one_turn_on = milling.cut_edge(x + milling.TURN)
    np.testing.assert_allclose(milling.cut_edge(x), one_turn_on, atol=1e-9)


# --- the lathe -----------------------------------------------------------------------------------


def test_the_lathe_is_drawn_for_the_section_it_turns():
    assert missing(partial(pictures.draw_lathe_setup, half_side=12.5e-3), "12.5 mm", "18 mm") == []


def areas(ax):
    """Corners of the filled outlines."""
    return [p.get_xy()[:-1] for p in ax.patches if isinstance(p, Polygon)]


def test_the_tool_touches_the_section_and_does_not_enter_it():
    _, ax = rendered(pictures.draw_lathe_setup)
    four = [c for c in areas(ax) if len(c) == 4]
    (square,) = (c for c in four if np.allclose(np.mean(c, axis=0), turning.CENTRE))
    (tool,) = (c for c in four if np.isclose(c[:, 0].max(), turning.SLIDE[0]))
    normal = square[[0, -1]].mean(axis=0) - turning.CENTRE  # of the side that faces the tool
    assert np.hypot(*normal) == pytest.approx(turning.INRADIUS)
    assert np.degrees(np.arctan2(normal[1], normal[0])) == pytest.approx(-30.0)  # turned clockwise
    depth = (tool - turning.CENTRE) @ normal / turning.INRADIUS - turning.INRADIUS
    assert depth[0] == pytest.approx(0.0, abs=1e-12)
    assert depth[1:].min() > 0.0


def test_the_graph_marks_the_radius_at_the_tool():
    """One turn is the width of the graph; heights run from the inradius to the corner."""
    _, ax = rendered(pictures.draw_lathe_setup)
    left, right, bottom, top = turning.GRAPH
    ((x, y, _),) = (c for c in outlines(ax)[1] if left < c[0] < right and c[1] > bottom)
    share = (1 / np.cos(turning.TURNED) - 1) / (np.sqrt(2) - 1)
    assert (x - left) / (right - left) == pytest.approx(30 / 360)
    assert (y - bottom) / (top - bottom) == pytest.approx(share, abs=1e-9)


# --- waviness ------------------------------------------------------------------------------------

FEED, CUTTER = HORNG1989.feed_speed / HORNG1989.spindle_frequency, HORNG1989.cutter_diameter / 2


def profile(eccentricity):
    _, ax = plt.subplots()
    pictures.draw_waviness(ax, HORNG1989, eccentricity)
    return ax.lines[0].get_xydata().T


def test_without_runout_every_tooth_leaves_a_scallop():
    """Depth of an arc of radius R and chord f/4: R - sqrt(R^2 - (f/8)^2), drawn in micrometres."""
    _, height = profile(0.0)
    depth = 1e6 * (CUTTER - np.sqrt(CUTTER**2 - (FEED / 8) ** 2))
    assert np.ptp(height) == pytest.approx(depth, rel=1e-6)


def test_with_runout_the_longest_tooth_leaves_one_wave_per_turn():
    """The next tooth is 5 um shorter and the wave only 0.95 um high: one tooth in four cuts."""
    x, height = profile(5e-6)
    depth = 1e6 * (CUTTER + 5e-6 - np.sqrt((CUTTER + 5e-6) ** 2 - (FEED / 2) ** 2))
    assert np.ptp(height) == pytest.approx(depth, rel=1e-6)
    period = int(np.argmin(abs(x - 1e3 * FEED)))
    np.testing.assert_allclose(height[:-period], height[period:], atol=1e-6)


def test_a_profile_longer_than_the_cutter_is_refused():
    _, ax = plt.subplots()
    with pytest.raises(ValueError, match=r"radius 0.0047\d+ m .* lengths are in metres"):
        pictures.draw_waviness(ax, replace(HORNG1989, feed_speed=1.9), 0.0)


# --- the face mill -------------------------------------------------------------------------------

MILL = face_mill.TSAO_PONG1991
CUT = facing.Cutter(MILL)
INSERTS = np.arange(1, 9)


def test_inserts_are_numbered_against_the_rotation():
    """The angle of insert i is that of the cutter minus i - 1 pitches, clockwise."""
    at = places(rendered(pictures.draw_face_mill_setup)[1])
    x, y = np.array([np.subtract(at[str(i)], facing.AXIS) for i in INSERTS]).T
    step = np.diff(np.unwrap(np.arctan2(x, y)))
    assert np.degrees(step) == pytest.approx([-45.0] * 7, abs=5.0)


def test_runout_is_that_of_the_paper_in_proportion_to_the_feed():
    drawn = (CUT.radii - np.roll(CUT.radii, 1)) / facing.TOOTH_FEED
    np.testing.assert_allclose(drawn, np.array(MILL.runout) / MILL.tooth_feed, rtol=1e-9)
    enlarged = facing.TOOTH_FEED / MILL.tooth_feed * MILL.diameter / 2 / facing.RADIUS
    assert enlarged == pytest.approx(200, rel=0.05)


def test_the_centre_is_where_inserts_on_a_circle_would_put_it():
    """The paper's runout is an eccentricity of 20 um: a third of the feed per tooth of 60 um."""
    tips = np.array([CUT.path(i, CUT.angle(i)) for i in INSERTS])
    distance = np.hypot(*(tips - CUT.centre).T)
    np.testing.assert_allclose(distance, facing.RADIUS, rtol=4e-3)
    offset = np.hypot(*(CUT.centre - facing.AXIS))
    assert offset == pytest.approx(facing.TOOTH_FEED / 3, rel=1e-4)


def test_half_of_the_inserts_touch_the_front_and_none_enters_it():
    """Just behind its edge an insert has cut, just ahead of it there is a layer to cut."""
    _, ax = rendered(pictures.draw_face_mill_setup)
    cutting = [i for i in INSERTS if 0 < CUT.angle(i) % (2 * np.pi) < np.pi]
    assert cutting == [1, 2, 3, 8]
    layers = (pen.FOCUS, facing.CHIP)
    for number in cutting:
        angle, outside = CUT.angle(number) % (2 * np.pi), 0.07
        own = CUT.path(number if number < 4 else number - 8, angle + np.array([-0.06, 0.06]))
        behind, ahead = (point - outside * (point - facing.AXIS) / facing.RADIUS for point in own)
        assert color(ax, behind) not in layers, number
        assert color(ax, ahead) in layers, number


def color(ax, point):
    """Colour of the ground at a point in data coordinates, as a hexadecimal string."""
    x, y = ax.transData.transform(point)
    pixels = layouts.ground(ax)
    return "#" + "".join(f"{c:02x}" for c in pixels[int(pixels.shape[0] - y), int(x)])


def test_the_drawn_chip_is_about_as_thick_as_the_label_says():
    """The model takes circles for the paths; the drawing, whose feed is large, the paths."""
    inner, outer = CUT.chip_ends()
    runout = CUT.radii[1] - CUT.radii[0]
    expected = facing.TOOTH_FEED * np.sin(facing.MEASURED) + runout
    assert np.hypot(*(outer - inner)) == pytest.approx(expected, rel=0.1)
    for end in (inner, outer):
        assert np.arctan2(*(end - facing.AXIS)) == pytest.approx(facing.MEASURED)


# --- boring at a varying speed -------------------------------------------------------------------


def test_the_trigger_angle_and_the_ellipse_belong_to_the_machine():
    bar = replace(boring.MACHINED, sampling_interval=250e-6 * 2 / 3, amplitude=12.5e-6)
    parts = ("360 samples a turn", "= 1°", "25 µm peak to peak")
    assert missing(partial(pictures.draw_boring_setup, bar=bar), *parts) == []


def tools(ax):
    return [p.get_xy()[:-1] for p in ax.patches if p.get_facecolor()[:3] == (110 / 255,) * 3]


def bore_radius(angle):
    return np.hypot(*(boring.bored(angle) - boring.END).T)


def test_the_tool_is_at_the_wall_of_the_bore_in_both_views():
    _, ax = rendered(pictures.draw_boring_setup)
    side, end = sorted(tools(ax), key=lambda xy: xy[:, 0].min())
    wall = boring.LEVEL + bore_radius(0.0)
    assert side[:, 1].max() == end[:, 1].max() == pytest.approx(wall)
    assert side[np.argmax(side[:, 1]), 0] == boring.EDGE
    offset = end - boring.END
    assert np.all(np.hypot(*offset.T) <= bore_radius(np.arctan2(*offset.T)) + 1e-9)


def test_samples_lie_on_the_bore_at_equal_angles_one_at_the_mark_and_one_at_the_tool():
    _, ax = rendered(pictures.draw_boring_setup)
    dots = np.array([c[:2] for c in outlines(ax)[1] if c[2] < pen.DOT]) - boring.END
    angle = np.arctan2(*dots.T)
    np.testing.assert_allclose(np.hypot(*dots.T), bore_radius(angle), rtol=1e-12)
    np.testing.assert_allclose(np.diff(np.sort(angle)), 2 * np.pi / boring.DOTS, rtol=1e-9)
    for at in (0.0, boring.TURNED):
        assert np.abs(angle - at).min() < 1e-12


def test_the_strip_joins_equal_steps_of_the_angle_to_the_instants_of_the_speed_law():
    """One turn per period of the speed, at a mean of 2 pi rad/s, so that the period is 1 s."""
    _, ax = rendered(pictures.draw_periodic_sampling)
    joined = [c.get_xydata() for c in ax.lines if len(c.get_xydata()) == 4]
    assert all(tuple(c[1:3, 1]) == (boring.ANGLES, boring.TIMES) for c in joined)
    above, below = np.sort([c[1:3, 0] for c in joined], axis=0).T
    n, width = boring.STEPS, boring.RIGHT - boring.LEFT

    def slowness(t):  # an independent quadrature of the speed law
        return t + boring.SWING * (1 - np.cos(2 * np.pi * t)) / (2 * np.pi)

    np.testing.assert_allclose(np.diff(above), width / n)
    np.testing.assert_allclose(
        slowness((below - boring.LEFT) / width), np.arange(n + 1) / n, atol=1e-9
    )
    np.testing.assert_allclose(sorted(x for x, _, _ in outlines(ax)[1]), below)
    gaps, at = np.diff(below), places(ax)
    for word, k in (("short $T(k)$", np.argmin(gaps)), ("long $T(k)$", np.argmax(gaps))):
        assert below[k] < at[word][0] < below[k + 1]


# --- regenerative chatter ------------------------------------------------------------------------


def test_the_chip_is_measured_at_the_edge_of_the_tool_from_one_surface_to_the_other():
    _, ax = rendered(pictures.draw_regeneration)
    tip = regeneration.TIP
    low, high = float(regeneration.surface(tip, 0)), float(regeneration.surface(tip, 1))
    label = places(ax)["$h(t)$"][0]
    ends = [y for x, y in heads(ax) if abs(x - label) < 0.8 and 1.5 < y < 4.0]
    assert sorted(ends) == pytest.approx([low, high])
    (tool,) = tools(ax)
    assert tuple(tool[np.argmin(tool[:, 1])]) == pytest.approx((tip, low))


def test_the_tool_always_cuts_and_has_just_the_marks_of_its_own_path_behind_it():
    _, ax = rendered(pictures.draw_regeneration)
    x = np.linspace(regeneration.LEFT, regeneration.RIGHT, 2000)
    assert np.all(regeneration.surface(x, 1) > regeneration.surface(x, 0))
    (tool,) = tools(ax)
    edge = np.linspace(tool[0], tool[-1], 50)[1:]  # its relief, from the tip
    assert np.all(edge[:, 1] > regeneration.surface(edge[:, 0], 0))


def test_the_drawn_lag_is_one_at_which_the_last_wave_feeds_the_vibration():
    """Work per cycle of the force K x(t - tau), which pushes the tool out of the cut."""
    cycle = np.linspace(0, regeneration.WAVE, 400, endpoint=False)
    x = regeneration.surface(regeneration.TIP - cycle, 0)  # time goes on to the left
    before = regeneration.surface(regeneration.TIP - cycle, 1)
    assert np.sum(before * np.gradient(x)) > 0


# --- teeth and chips -----------------------------------------------------------------------------


def test_a_tooth_has_a_bar_of_its_value_and_follows_anticlockwise():
    _, ax = plt.subplots(subplot_kw={"projection": "polar"})
    assert pictures.draw_teeth(ax, [3.0, 5.0, 4.0], 4.0, "before") is ax
    bars = ax.patches
    assert [bar.get_height() for bar in bars] == [3.0, 5.0, 4.0]
    middle = [bar.get_x() + bar.get_width() / 2 for bar in bars]
    assert middle == pytest.approx([0, 2 * np.pi / 3, 4 * np.pi / 3])
    assert (ax.get_theta_offset(), ax.get_theta_direction()) == (np.pi / 2, 1)
    assert [t.get_text() for t in ax.get_xticklabels()] == ["1", "2", "3"]
    assert np.all(ax.lines[-1].get_ydata() == 4.0)


def test_a_second_set_of_bars_leaves_the_first_to_be_seen():
    _, ax = plt.subplots(subplot_kw={"projection": "polar"})
    pictures.draw_teeth(ax, np.full(8, 2.0), 1.0, "before")
    pictures.draw_teeth(ax, np.full(8, 1.0), 1.0, "after", outlined=True)
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
    assert pictures.draw_cutter_chips(ax, angle, thickness, 0.05, 200, 60e-6) is ax
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
        pictures.draw_cutter_chips(ax, [np.pi / 2], [chip], 0.05, 200, feed=60e-6)
        assert ax.lines[0].get_xdata().max() == pytest.approx(0.05 + 200 * 60e-6)
    assert axes[0].get_xlim() == axes[1].get_xlim()
    assert axes[0].get_ylim() == axes[1].get_ylim()


# --- a bore --------------------------------------------------------------------------------------

ANGLE = 2 * np.pi * np.arange(480) / 240  # two turns
ELLIPSE = 23e-6 * np.sin(2 * ANGLE)


def bore(error, magnified=1, reach=35e-6):
    _, ax = plt.subplots(subplot_kw={"projection": "polar"})
    assert pictures.draw_bore(ax, ANGLE, ELLIPSE, error, magnified, reach) is ax
    ax.get_figure().draw_without_rendering()
    return ax


def test_a_bore_is_what_is_desired_less_the_magnified_error_in_micrometres():
    ax = bore(4e-6 * np.cos(ANGLE), 2)
    circle, desired, cut = ax.lines
    assert np.all(circle.get_ydata() == 0)
    np.testing.assert_allclose(desired.get_ydata()[:-1], 1e6 * ELLIPSE)
    drawn = 1e6 * ELLIPSE - 8 * np.cos(ANGLE)
    np.testing.assert_allclose(cut.get_ydata(), [*drawn, drawn[0]])  # closed
    assert [t.get_text() for t in ax.texts] == ["rings\n±20 µm\nerror 2×"]


def test_bores_with_the_same_reach_share_their_scale():
    one, other = (bore(e * np.sin(ANGLE)) for e in (1e-6, 5e-6))
    assert one.get_rmax() == other.get_rmax() == -one.get_rmin() == pytest.approx(35)
    assert one.get_rorigin() == other.get_rorigin()
    assert [t.get_text() for t in one.texts] == ["rings\n±20 µm"]


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


# --- runs side by side, and tables ---------------------------------------------------------------


def test_cuts_stand_side_by_side_under_their_names():
    runs = [face_mill.simulate(face_mill.Experiment(MILL, turns=n, substeps=1)) for n in (1, 2)]
    _, axes = plt.subplots(4, 2)
    pictures.draw_cuts(axes, {"one": runs[0], "two": runs[1]})
    where = plt.rcParams["axes.titlelocation"]
    assert [ax.get_title(where) for ax in axes[0]] == ["one", "two"]
    for column, run in zip(axes.T, runs, strict=True):
        np.testing.assert_array_equal(column[2].lines[0].get_ydata(), run.current)
    assert axes[0, 0].get_ylabel() and not axes[0, 1].get_ylabel()
    with pytest.raises(ValueError, match="shorter"):
        pictures.draw_cuts(axes, {"one": runs[0]})
    plt.close("all")


def test_moments_show_the_largest_force_of_their_time():
    run = face_mill.simulate(face_mill.Experiment(MILL, turns=3, substeps=8))
    fig, axes = plt.subplots(1, 2)
    pictures.draw_moments(axes, run, 3, (0.25, 0.5), 300)
    for ax, moment in zip(axes, (0.25, 0.5), strict=True):
        now = round((2 + moment) * 320) + 1  # 320 steps per turn; a turn begins behind its start
        assert ax.get_title("center") == f"{run.force[now]:.0f} N"
    plt.close(fig)


def test_lines_carry_their_labels():
    _, ax = plt.subplots()
    assert pictures.draw_lines(ax, [1, 2], {"a": [3, 4], "b": [5, 6]}, ylabel="force (N)") is ax
    assert [line.get_label() for line in ax.lines] == ["a", "b"]
    assert ax.lines[1].get_ydata().tolist() == [5, 6] and ax.get_ylabel() == "force (N)"
    plt.close("all")


def test_a_table_has_a_row_for_each_name_and_dashes():
    html = pictures.table({"a": {"x": 1.25, "y": None}, "b": {"x": 2.0, "y": "word"}}, 2).to_html()
    assert [cell in html for cell in (">1.25<", ">–<", ">2.00<", ">word<", ">a<", ">y<")] == [
        True
    ] * 6
