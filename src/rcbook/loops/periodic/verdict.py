"""Stable, unstable or undecided, with grounds.

=============== ===================================================== =========================
method          answers                                               certificate
=============== ===================================================== =========================
`energy_gain`   stable, when K shrinks the energy of every sequence   sufficient; a storage
                                                                      function was computed
`count_outside` stable or unstable: multipliers beyond a circle       steps and rounding are
                                                                      checked, else undecided
`multipliers`   all of them, from the dense one-period matrix         first-order bounds of what
                                                                      rounding does to them
=============== ===================================================== =========================

The first two need a memory q z^-N and O(N) work; the last takes any memory and O(N^3) work.
"""

from __future__ import annotations

from weakref import WeakKeyDictionary

import numpy as np
import scipy.linalg

from rcbook.loops.periodic.count import count_outside
from rcbook.loops.periodic.energy import dissipates
from rcbook.loops.periodic.growth import dense
from rcbook.loops.periodic.loop import PeriodicLoop
from rcbook.loops.periodic.plant import PeriodicPlant
from rcbook.loops.verdict import Verdict, judged

_ROUNDING = 1e-14  # of the norm of the matrix, a change that it has suffered for certain


_KNOWN: WeakKeyDictionary[PeriodicLoop, Verdict] = WeakKeyDictionary()


def verdict(loop: PeriodicLoop) -> Verdict:
    """Stable, unstable or undecided: in O(N) work for a memory q z^-N, else from all multipliers.

    "stable" by `energy_gain` below one needs no multipliers; else they are counted on the unit
    circle.  "undecided" means that rounding in the data moves multipliers across it: the powers
    of the one-period map then grow far before they decay, if they do; see `transient_growth`.
    A loop that is asked again is not judged again.
    """
    if loop not in _KNOWN:
        _KNOWN[loop] = _judge(loop)
    return _KNOWN[loop]


def _judge(loop: PeriodicLoop) -> Verdict:
    if not loop.has_window:
        return _by_multipliers(loop)
    if decays(loop.plant) and dissipates(loop.window, np.array([1.0 - 1e-6]))[0]:
        grounds = "a storage function shows that every period shrinks the energy of u"
        return Verdict("stable", "energy", grounds, 0)
    found = count_outside(loop)
    grounds = (
        f"{found.points} points of the half circle, largest step {found.largest_step:.2g}, "
        f"largest change {found.largest_change:.1g} for data changed by 1e-10"
    )
    if found.outside is None:
        return Verdict("undecided", "count", grounds, None)
    return Verdict("unstable" if found.outside else "stable", "count", grounds, found.outside)


def _by_multipliers(loop: PeriodicLoop) -> Verdict:
    """From eigenvalues and the condition of each; undecided where rounding may cross the circle."""
    matrix = dense(loop)
    values, left, right = scipy.linalg.eig(matrix, left=True)
    aligned = np.maximum(np.abs(np.sum(left.conj() * right, axis=0)), np.finfo(float).tiny)
    moved = _ROUNDING * np.linalg.norm(matrix, 2) / aligned
    sizes = np.abs(values)
    grounds = (
        f"largest of {sizes.size} multipliers {sizes.max():.9g}, moved by up to "
        f"{moved[np.argmax(sizes + moved)]:.1g} by rounding"
    )
    if np.any(sizes - moved > 1) or np.all(sizes + moved < 1):
        return judged(sizes.max(), "multipliers", grounds, int(np.sum(sizes > 1)))
    return Verdict("undecided", "multipliers", grounds)


def decays(plant: PeriodicPlant) -> bool:
    """Whether the plant by itself forgets its state, seen at the output or not."""
    product = np.eye(plant.order)
    with np.errstate(over="ignore", invalid="ignore"):
        for a in plant.a:
            product = a @ product
    return bool(np.all(np.isfinite(product)) and np.abs(np.linalg.eigvals(product)).max() < 1)
