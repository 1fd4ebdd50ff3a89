"""Learning from pass to pass: the error of one pass, filtered, corrects the command of the next.

    u_(L+1) = q (u_L + H e_L),    e_L = r - y_L,    y_L = G (u_L + w),    u_0 = r

G is the plant, H the law (a noncausal filter, its gain included), q a symmetric filter, w a
disturbance.  A `Scheme` holds them; the law is designed on one plant and the passes run on another,
so mismatch is one argument; a first command u_0 other than the reference is another.
"""

from rcbook.loops.learning.judgement import (
    contraction,
    factor,
    harmonic_contraction,
    mismatch,
    multipliers,
    roots,
    spectral_radius,
    steady_state,
    verdict,
)
from rcbook.loops.learning.laws import (
    LearningLaw,
    norm_optimal_law,
    p_type_law,
    zero_phase_law,
)
from rcbook.loops.learning.noise import noise_gain
from rcbook.loops.learning.passes import Passes, simulate, track
from rcbook.loops.learning.scheme import CONTINUOUS, PERIODIC, RESET, Scheme, Start
from rcbook.loops.run import Limit, Limits
from rcbook.loops.verdict import Verdict

__all__ = [
    "CONTINUOUS",
    "PERIODIC",
    "RESET",
    "LearningLaw",
    "Limit",
    "Limits",
    "Passes",
    "Scheme",
    "Start",
    "Verdict",
    "contraction",
    "factor",
    "harmonic_contraction",
    "mismatch",
    "multipliers",
    "noise_gain",
    "norm_optimal_law",
    "p_type_law",
    "roots",
    "simulate",
    "spectral_radius",
    "steady_state",
    "track",
    "verdict",
    "zero_phase_law",
]
