"""Loops that repeat every N samples: plants sampled at T(k), compensators to match.

Signals, with the symbols used throughout::

    e(k) = r(k) - y(k) - noise(k)
    w(k) = u(k-L) + e(k),    u = z^L H w                 memory H, for the plain one q z^-N
    v(k) = gain sum_j c_j(k) u(k-j)                      compensator, N-periodic taps
    x(k+1) = A(k) x(k) + B(k) (v(k) + disturbance(k)),    y(k) = C x(k)

`recursion` is one period of it, and answers what is simulated, in steady state, noisy or growing.
With the memory q z^-N the loop is u = z^-N K u, where the `window` K = q (1 - z^L G_c G_p) looks a
few samples ahead and forgets soon; from it O(N) work tells stability at any period.

Source: Hanson and Tsao (2000), eqs 1-13 and appendix.
"""

from rcbook.loops.memory import Memory, odd_harmonic, plain, several
from rcbook.loops.periodic.compensator import Compensator, least_squares, zero_phase
from rcbook.loops.periodic.count import Count, count_outside
from rcbook.loops.periodic.energy import absolute_gain, energy_gain
from rcbook.loops.periodic.growth import (
    dense,
    multipliers,
    one_period_map,
    transient_growth,
)
from rcbook.loops.periodic.lifted import (
    closed_loop_matrix,
    lift,
    lift_by_products,
    lifted,
    multiplications,
    product_of_matrices,
)
from rcbook.loops.periodic.loop import PeriodicLoop, factor, mismatch
from rcbook.loops.periodic.noise import noise_gain
from rcbook.loops.periodic.plant import PeriodicPlant, balanced, between_samples, sample
from rcbook.loops.periodic.radius import radius_bounds, spectral_radius
from rcbook.loops.periodic.response import simulate, steady_state
from rcbook.loops.periodic.search import frozen_gain_bound, vanishing_intervals
from rcbook.loops.periodic.verdict import verdict
from rcbook.loops.run import Limit, Limits, Run
from rcbook.loops.verdict import OUTPUTS, SOURCES, Verdict
