"""Pictures of the book: block diagrams, machines and results, each drawn on a given axes.

A new machine gets a module of its own here.  Its `draw_` functions need nothing but axes, have the
machine's parameters as defaults and return the axes; the tests find them and apply their rules.
"""

from rcbook.pictures.blocks import Block, Frame, Node, Sum, Wire, draw_block_diagram, path, row
from rcbook.pictures.boring_bar import draw_boring_setup, draw_periodic_sampling
from rcbook.pictures.chatter import draw_regeneration
from rcbook.pictures.face_mill import draw_face_mill_setup
from rcbook.pictures.lathe import draw_lathe_setup
from rcbook.pictures.loops import (
    draw_angle_loop,
    draw_feedback_loop,
    draw_learning_loop,
    draw_periodic_loop,
    draw_repetitive_generator,
    draw_spindle_drive,
)
from rcbook.pictures.peripheral_mill import draw_milling_setup
from rcbook.pictures.results import (
    GREY,
    LABELS,
    draw_band,
    draw_bore,
    draw_cut,
    draw_cuts,
    draw_cutter_chips,
    draw_lines,
    draw_locus,
    draw_moments,
    draw_poles_zeros,
    draw_section,
    draw_signal,
    draw_teeth,
    draw_unit_circle,
    draw_unit_disc,
    draw_waviness,
    mark_revolutions,
    table,
    use_style,
)
from rcbook.pictures.sketch import Sketch
