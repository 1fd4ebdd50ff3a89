"""What a scheme comes to: factor, stability, the learned limit, and what noise leaves of it."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from rcbook import zdomain
from rcbook.loops import memory
from rcbook.loops.learning.passes import Passes, one_period, one_row
from rcbook.loops.learning.scheme import Scheme, answer, circular, one_pass
from rcbook.loops.verdict import Verdict, judged, require_stable


def factor(scheme: Scheme, z: ArrayLike) -> np.ndarray:
    """q (1 - G H) at points z of the unit circle: one learning scales the way to the limit by it.

    Source: Lee, Oh and Kim, eq. 6.
    """
    gh = zdomain.response(scheme.plant, z) * zdomain.response(scheme.law.filter, z)
    return memory.factor(scheme.controller.memory, gh, z)


def mismatch(scheme: Scheme, z: ArrayLike) -> np.ndarray:
    """G/G_model - 1 at points z; 0 where no other model is known."""
    if scheme.model is None:
        return np.zeros(np.shape(z), dtype=complex)
    return zdomain.response(scheme.plant, z) / zdomain.response(scheme.model, z) - 1


def contraction(scheme: Scheme, points: int = 4096) -> float:
    """Largest |q (1 - G H)| over the unit circle; below one is sufficient for a stable law.

    Source: Lee, Oh and Kim, eq. 8.
    """
    points = zdomain.whole_number(points, "points")
    half = zdomain.unit_circle(2 * points)[: points + 1]
    return float(np.abs(factor(scheme, half)).max())


def harmonic_contraction(scheme: Scheme) -> np.ndarray:
    """|q (1 - G H)| at the harmonics 0 .. period/2, on which alone a periodic pass depends."""
    harmonics = zdomain.unit_circle(scheme.period)
    return np.abs(factor(scheme, harmonics[: harmonics.size // 2 + 1]))


# ---- stability ----


def roots(scheme: Scheme) -> np.ndarray:
    """Roots of a continuous run, one step of them a sample, by decreasing magnitude.

    They come from exact coefficients; that holds for passes of up to some thousand samples.
    Raises ValueError for another start, which has no recursion over samples.
    """
    if scheme.start.before != "previous":
        raise ValueError(
            f"{scheme.start}: passes that do not follow one another have no roots per sample; ask "
            "for multipliers, or start CONTINUOUS"
        )
    return scheme.roots


def multipliers(scheme: Scheme) -> np.ndarray:
    """Factors by which one learning scales the modes of a pass, by decreasing magnitude.

    For passes that repeat for ever `factor` at the harmonics, for a continuous run its roots to
    the power of the period, for starts from rest the eigenvalues of the one-pass matrix.  Commands
    that answer after a pass from rest are left out.
    """
    if scheme.start.before == "previous":
        return scheme.roots**scheme.period
    if scheme.start.before == "itself":
        found = factor(scheme, zdomain.unit_circle(scheme.period))
    else:
        found = np.linalg.eigvals(scheme.one_pass[: scheme.corrected, : scheme.corrected])
    return found[np.argsort(-np.abs(found), kind="stable")]


def spectral_radius(scheme: Scheme) -> float:
    """Largest |multiplier| of a pass: below one is necessary and sufficient for convergence."""
    return float(np.abs(multipliers(scheme)).max(initial=0.0))


def verdict(scheme: Scheme) -> Verdict:
    """Whether the passes converge; within 1e-9 of the unit circle is "undecided"."""
    if scheme.start.before == "previous":
        largest = float(np.abs(scheme.roots).max(initial=0.0))
        return judged(largest, "characteristic polynomial", f"largest root {largest:.9g} a sample")
    largest = spectral_radius(scheme)
    if scheme.start.before == "itself":
        certificate = f"largest factor {largest:.9g} at {scheme.period} harmonics"
        return judged(largest, "harmonics of the pass", certificate)
    certificate = f"largest eigenvalue {largest:.9g} a pass"
    return judged(largest, "one-pass matrix", certificate)


def require_limit(scheme: Scheme) -> None:
    """Raise ValueError unless the scheme is stable."""
    require_stable(verdict(scheme), "lower the gain of the law, or give it a filter q")


def steady_state(
    scheme: Scheme, reference: ArrayLike, *, disturbance: ArrayLike | None = None, rest: float = 0.0
) -> Passes:
    """The pass to which learning converges, computed and not waited for: one row.

    A continuous run has the limit of passes that repeat for ever.  `rest` matters to starts from
    rest only, whose commands that answer after the pass are left at the reference.
    Raises ValueError when the scheme is not stable, because then there is none, and for signals
    of another length than a pass.
    """
    r, w = one_period(scheme, reference, disturbance)
    rest = zdomain.real_number(rest, "rest")
    require_limit(scheme)
    if scheme.start.before == "rest":
        nothing, k = np.zeros(r.size), scheme.corrected
        _, driven = one_pass(scheme, nothing, w, r, nothing, rest)
        u = np.append(np.linalg.solve(np.eye(k) - scheme.one_pass[:k, :k], driven[:k]), r[k:])
        return one_row(scheme, r, w, u, answer(scheme, u + w, rest))
    z = zdomain.unit_circle(r.size)
    once = scheme.controller.memory.gain(z) * zdomain.response(scheme.law.filter, z)
    driven = once * np.fft.fft(r - circular(scheme.plant, w))
    u = np.fft.ifft(driven / (1 - factor(scheme, z))).real
    return one_row(scheme, r, w, u, circular(scheme.plant, u + w))
