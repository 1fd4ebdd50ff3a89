"""The loops of the case studies: each is a table of items and of the wires between them."""

from collections.abc import Sequence

from matplotlib.axes import Axes

from rcbook.machines import face_mill, spindle_drive
from rcbook.machines.face_mill import FaceMill
from rcbook.machines.spindle_drive import SpindleDrive
from rcbook.pictures import blocks
from rcbook.pictures.blocks import Block, Frame, Node, Sum, Wire, path, row
from rcbook.pictures.sketch import DISTURBED, FOCUS, PAPER, PLANT

_ADD = {"w": "+", "n": "+"}  # signs of a sum that is entered from the left and from above


def draw_feedback_loop(
    ax: Axes,
    parts: Sequence[str] = ("controller", "plant"),
    signals: Sequence[str] = ("$r$", "$e$", "$u$", "$y$"),
    disturbance: str = "",
    inner_loop: str = "",
    focus: bool = False,
) -> Axes:
    """Draw a unity feedback loop, or nested ones, from the texts of parts and signals in order.

    Every part but the last, the plant, acts on an error of its own; the outermost comes first and
    is tinted to be in `focus`.  A `disturbance` enters the plant; `inner_loop` names the innermost.
    Raises ValueError unless there are twice as many signals as parts.
    """
    if len(signals) != 2 * len(parts):
        raise ValueError(f"{len(parts)} parts have {2 * len(parts)} signals: not {len(signals)}")
    line, last = [], len(parts) - 2
    for k, part in enumerate(parts[:-1]):
        block = Block(f"controller {k}", part, fill=FOCUS if focus and k == 0 else PAPER)
        line += [signals[2 * k], Sum(f"error {k}"), signals[2 * k + 1], block]
    load = [Sum("load", signs=_ADD), ""] if disturbance else []
    line += [signals[-2], *load, Block("plant", parts[-1], fill=PLANT)]
    for k in range(last, -1, -1):
        line += ["", Node(f"out {k}")]
    items, wires = row(*line, signals[-1])
    at = {item.name: item.xy[0] for item in items}
    wires += [Wire(f"out {k}", f"error {k}", via=-1.3 - 0.7 * (last - k)) for k in range(last)]
    wires.append(Wire(f"out {last}", f"error {last}", inner_loop, via=-1.3))
    if inner_loop:
        left, right = at[f"error {last}"] - 0.6, at[f"out {last}"] + 0.22
        items.append(Frame("inner loop", ((left + right) / 2, -0.375), right - left, 2.35))
    if disturbance:
        wires.append(Wire((at["load"], 1.1), "load", disturbance, color=DISTURBED))
    return blocks.draw_block_diagram(ax, items, wires)


def draw_learning_loop(ax: Axes) -> Axes:
    """Draw learning from pass to pass: the error through the law corrects the next command."""
    items = [
        Block("memory", "memory of\none pass", (0.0, 0.0), FOCUS),
        Node("command", (3.2, 0.0)),
        Block("plant", "$G$", (5.4, 0.0), PLANT),
        Sum("error", (8.0, 0.0), {"w": "−", "n": "+"}),
        Block("law", "$C$", (5.4, -2.0), FOCUS),
        Sum("corrected", (3.2, -2.0), {"n": "+", "e": "+"}),
    ]
    wires = [
        *path("memory", "$v_m$", "command", "", "plant", "$y_m$", "error"),
        Wire((8.0, 1.3), "error", "$r$"),
        Wire("error", "law", "$e_m$", via=-2.0),
        *path("law", "", "corrected"),
        Wire("command", "corrected"),
        Wire("corrected", "memory", "$v_{m+1}$", via=-2.0),
    ]
    return blocks.draw_block_diagram(ax, items, wires)


def draw_repetitive_generator(ax: Axes) -> Axes:
    """Draw the inside of a repetitive controller, `k_r q z^-N C / (1 - q z^-N)` as a whole.

    C looks L samples ahead, so it is causal together with the part z^-L of the delay.
    """
    items, wires = row(
        *("$e$", Block("gain", "$k_r$"), "", Sum("sum", signs={"w": "+", "s": "+"}), ""),
        *(Block("memory", r"$q(z)\,z^{-(N-L)}$", fill=FOCUS), "", Node("tap"), ""),
        *(Block("compensator", r"$z^{-L}\,C(z)$"), "$u$"),
    )
    (middle,) = (item.xy[0] for item in items if item.name == "memory")
    items.append(Block("rest", r"$z^{-L}$", (middle, -1.5), FOCUS))
    wires += [Wire("tap", "rest", via=-1.5), Wire("rest", "sum", via=-1.5)]
    return blocks.draw_block_diagram(ax, items, wires)


def draw_spindle_drive(ax: Axes, drive: SpindleDrive = spindle_drive.TSAO_PONG1991) -> Axes:
    """Draw the cascade of a spindle drive, from speed command to speed, and the cut as its load."""
    tall, limit = {"height": 1.4}, {"title": "current limit", "icon": blocks.LIMITED}
    proportional = r"$K_{pv}+\dfrac{K_{iv}}{s}$"
    current = r"$K_u\left(K_{pi}+\dfrac{K_{ii}}{s}\right)$"
    items = [
        Sum("speed error", (1.9, 0.0)),
        Block("velocity", proportional, (4.4, 0.0), title="velocity control", **tall),
        Block("limit", f"{drive.current_limit:g} A", (7.4, 0.0), **limit, **tall),
        Sum("current error", (9.8, 0.0)),
        Block("current", current, (12.3, 0.0), title="current control", **tall),
        Sum("voltage", (15.6, -3.5), {"n": "+", "s": "−"}),
        Block("motor", r"$\dfrac{1}{L_a s+R_a}$", (12.6, -3.5), PLANT, title="armature", **tall),
        Node("i", (9.8, -3.5)),
        Block("sensor", "$K_f$", (9.8, -1.75)),
        Block("torque", "$C_{w1}$", (8.4, -3.5), PLANT),
        Sum("torque error", (6.6, -3.5), {"e": "+", "s": "−"}),
        Block("inertia", r"$\dfrac{1}{Js+B}$", (4.7, -3.5), PLANT, title="spindle", **tall),
        Node("cut off", (3.0, -3.5)),
        Node("w", (1.9, -3.5)),
        Block("tacho", r"$\dfrac{C_{wt}}{T_g s+1}$", (1.9, -1.75), **tall),
        Block("cut", "cut $G_d$", (4.7, -5.1), FOCUS),
        Block("emf", "$C_{w2}$", (8.4, -6.2), PLANT),
    ]
    wires = [
        *path((0.0, 0.0), "$v$", "speed error", "", "velocity", "", "limit"),
        *path("limit", "$U_i^*$", "current error", "", "current", "voltage", "voltage"),
        *path("voltage", "", "motor", "$i$", "i", "", "sensor", "", "current error"),
        *path("i", "", "torque", "", "torque error", "", "inertia", "", "cut off", "", "w"),
        *path("w", "", "tacho", "", "speed error"),
        Wire("w", (0.0, -3.5), r"$\Omega$"),
        Wire("cut off", "cut", via=-5.1, dashed=True),
        Wire("cut", "torque error", r"$T_\mathrm{cut}$", color=DISTURBED, dashed=True),
        *(Wire("w", "emf", via=-6.2), Wire("emf", "voltage", "back EMF")),
    ]
    return blocks.draw_block_diagram(ax, items, wires)


def draw_angle_loop(ax: Axes, mill: FaceMill = face_mill.TSAO_PONG1991) -> Axes:
    """Draw the repetitive loop that samples at equal steps of the cutter's turn."""
    step, size = f"{360 / mill.samples_per_turn:g}°", {"width": 2.0, "height": 1.5}
    items = [
        Sum("error", (1.9, 0.0)),
        Block("gain", "$k_r$", (3.7, 0.0), FOCUS),
        Sum("learned", (5.4, 0.0), _ADD),
        Block("memory", r"$q\,z^{-N}$", (7.9, 0.0), FOCUS, title="memory of a turn"),
        Node("tap", (9.95, 0.0)),
        Block("inverse", "$C$", (11.5, 0.0), FOCUS),
        Sum("command", (13.6, 0.0), _ADD),
        Block("hold", f"hold {step}", (15.6, -3.4), icon=blocks.HELD, **size),
        Block("drive", "spindle\ndrive", (12.25, -3.4), PLANT, **size),
        Block("cut", "cut", (9.0, -3.4), PLANT, **size),
        Block("largest", "max over\nteeth", (5.75, -3.4), **size),
        Block("sampler", f"sampled\nevery {step}", (1.9, -3.4), **size),
        Frame("angle", (9.0, -3.55), 9.0, 3.2, title=r"in the cutter angle $\theta$"),
    ]
    wires = [
        *path((0.0, 0.0), "$r$", "error", "$e$", "gain", "", "learned", "", "memory", "", "tap"),
        *path("tap", "", "inverse", "$u$", "command", "$v$", "hold"),
        *path("hold", "", "drive", r"$\Omega$", "cut"),
        *path("cut", "$F_i$", "largest", "$y$", "sampler", "", "error"),
        Wire("tap", "learned", via=1.55),
        Wire((13.6, 1.2), "command", "nominal $v_0$"),
        Wire("cut", "drive", r"$T_\mathrm{cut}$", via=-4.8, dashed=True),
        Wire((9.0, -1.75), "cut", r"runout $\Delta_i$", color=DISTURBED),
    ]
    return blocks.draw_block_diagram(ax, items, wires)


def draw_periodic_loop(ax: Axes) -> Axes:
    """Draw the repetitive loop whose hold and sampler act at equal steps of the spindle's turn."""
    size = {"width": 2.0, "height": 1.4}
    items = [
        *(Sum("error", (1.7, 0.0)), Sum("learned", (4.1, 0.0), _ADD)),
        Block("memory", r"$q\,z^{-(N-L)}$", (7.15, 0.0), FOCUS),
        Block("rest", "$z^{-L}$", (7.15, 1.5), FOCUS),
        Node("tap", (9.4, 0.0)),
        Block("compensator", "$C(k)$", (12.0, 0.0), FOCUS),
        Block("hold", "hold $T(k)$", (14.4, -2.6), icon=blocks.HELD, **size),
        Block("plant", "$G(s)$", (9.4, -2.6), PLANT, **size),
        Block("sampler", "sampled\n$T(k)$", (4.4, -2.6), **size),
        Node("y", (1.7, -2.6)),
        Block("spindle", r"encoder, every $\Delta\theta$", (9.4, -4.5)),
        Frame("period", (6.55, 0.6), 6.4, 3.6, title="memory of one period"),
    ]
    wires = [
        *path((0.0, 0.0), "$r(k)$", "error", "$e(k)$", "learned", "", "memory", "", "tap"),
        *path("tap", "$u(k)$", "compensator", "$v(k)$", "hold", "$v(t)$", "plant"),
        *path("plant", "$y(t)$", "sampler", "$y(k)$", "y", "", "error"),
        *(Wire("tap", "rest", via=1.5), Wire("rest", "learned", via=1.5)),
        Wire("y", (0.0, -2.6)),
        *(Wire("spindle", end, dashed=True) for end in ("hold", "sampler")),
    ]
    return blocks.draw_block_diagram(ax, items, wires)


def draw_delay_line(ax: Axes, cells: int = 6) -> Axes:
    """Draw a memory of one period: `cells` numbers in a row that wait, are used and come again."""
    row_of = [Block(f"cell {k}", f"{k + 1}", (1.5 * k, 0.0), FOCUS) for k in range(cells)]
    end = row_of[-1].xy[0]
    items = [
        *row_of,
        Sum("corrected", (-1.9, 0.0), {"n": "+", "s": "+"}),
        Node("used", (end + 1.3, 0.0)),
    ]
    wires = [
        *path("corrected", "", "cell 0"),
        *(Wire(f"cell {k}", f"cell {k + 1}") for k in range(cells - 1)),
        *path(f"cell {cells - 1}", "", "used", "to the machine", (end + 4.2, 0.0)),
        Wire("used", "corrected", "the same number, a turn later", via=-1.4),
        Wire((-1.9, 1.5), "corrected", "a part of the error", color=DISTURBED),
    ]
    return blocks.draw_block_diagram(ax, items, wires)
