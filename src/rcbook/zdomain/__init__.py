"""Sampled plants in the backward shift, and their zero-phase inverse.

Polynomials in z^-1 are 1-D arrays, lowest power first: ``[1, -0.5]`` is 1 - 0.5 z^-1.
"""

from rcbook.zdomain.checks import (
    polynomial,
    real_number,
    whole_number,
)
from rcbook.zdomain.inverse import (
    NORMALISATIONS,
    split_zeros,
    zero_phase_inverse,
)
from rcbook.zdomain.plant import (
    NoncausalFilter,
    Plant,
    response,
)
from rcbook.zdomain.polynomials import (
    add,
    at_frequency,
    evaluate,
    multiply,
    rms_gain,
    shift,
    sorted_roots,
    turns_round_origin,
    unit_circle,
)
from rcbook.zdomain.qfilter import (
    binomial_q,
    odd_symmetric,
    symmetric_fir,
    zero_phase_gain,
)
from rcbook.zdomain.sampling import (
    hold_matrices,
    hold_polynomials,
    interval_integral,
    modes,
    phi1,
    phi2,
    zero_order_hold,
)
from rcbook.zdomain.search import boundary, first_crossing

__all__ = [
    "NORMALISATIONS",
    "NoncausalFilter",
    "Plant",
    "add",
    "at_frequency",
    "binomial_q",
    "boundary",
    "evaluate",
    "first_crossing",
    "hold_matrices",
    "hold_polynomials",
    "interval_integral",
    "modes",
    "multiply",
    "odd_symmetric",
    "phi1",
    "phi2",
    "polynomial",
    "real_number",
    "response",
    "rms_gain",
    "shift",
    "sorted_roots",
    "split_zeros",
    "symmetric_fir",
    "turns_round_origin",
    "unit_circle",
    "whole_number",
    "zero_order_hold",
    "zero_phase_gain",
    "zero_phase_inverse",
]
