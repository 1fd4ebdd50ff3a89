"""Sampled plants in the backward shift, and their zero-phase inverse.

Polynomials in z^-1 are 1-D arrays, lowest power first: ``[1, -0.5]`` is 1 - 0.5 z^-1.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from numbers import Integral, Real

import control
import numpy as np
from numpy.typing import ArrayLike

NORMALISATIONS = ("peak", "dc", "l1")
_ON_CIRCLE = 1e-9  # a pole this close to the unit circle is taken to lie on it
# A zero of multiplicity m is known to eps^(1/m) only; keeping one that lies inside does no harm.
_NEAR_CIRCLE = 1e-4


def polynomial(coefficients: ArrayLike, name: str = "polynomial") -> np.ndarray:
    """Coerce to a read-only 1-D float array, lowest power of z^-1 first.

    Raises ValueError when it is empty, has more than one axis, or holds NaN or infinity.
    """
    array = np.array(coefficients, ndmin=1)
    if np.iscomplexobj(array):
        raise ValueError(f"{name} = {array} is complex; give real coefficients")
    array = array.astype(float)
    if array.ndim != 1 or array.size == 0:
        raise ValueError(f"{name} has shape {array.shape}; give one non-empty row of coefficients")
    if not np.all(np.isfinite(array)):
        raise ValueError(f"{name} = {array} holds NaN or infinity; give finite coefficients")
    array.setflags(write=False)
    return array


def whole_number(value: object, name: str, least: int = 1, mend: str = "round it") -> int:
    """Coerce to an int not below `least`; 6.0 is accepted, 6.4 is not.

    Raises ValueError otherwise.
    """
    whole = isinstance(value, Integral) or (isinstance(value, float) and value.is_integer())
    if not whole or isinstance(value, bool) or value < least:
        raise ValueError(f"{name} = {value!r} must be a whole number not below {least}; {mend}")
    return int(value)


def real_number(value: object, name: str, positive: bool = False) -> float:
    """Coerce to a finite float, a positive one if asked.

    Raises ValueError otherwise.
    """
    fits = isinstance(value, Real) and not isinstance(value, bool) and np.isfinite(value)
    if not fits or (positive and not value > 0):
        kind = "positive" if positive else "real"
        raise ValueError(f"{name} = {value!r} must be a {kind} finite number")
    return float(value)


@dataclass(frozen=True, eq=False)
class Plant:
    """Sampled plant z^-delay b(z^-1)/a(z^-1), with a scaled so that a[0] = 1.

    Raises ValueError for a[0] = 0 or a negative delay (improper), b[0] = 0 (count that as delay),
    NaN, and a sampling interval that is not positive.
    """

    b: np.ndarray
    a: np.ndarray
    delay: int
    dt: float  # s

    def __post_init__(self) -> None:
        a, b = polynomial(self.a, "denominator a"), polynomial(self.b, "numerator b")
        if a[0] == 0:
            raise ValueError(f"a = {a} begins with 0: the plant is improper; drop the zero")
        if b[0] == 0:
            raise ValueError(f"b = {b} begins with 0; drop it and add one to the delay")
        with np.errstate(over="ignore"):
            b, scaled = b / a[0], a / a[0]
        if not np.all(np.isfinite([*b, *scaled])):
            raise ValueError(f"a = {a} begins too small to divide by; scale a and b up")
        object.__setattr__(self, "dt", real_number(self.dt, "sampling interval dt", positive=True))
        object.__setattr__(self, "b", polynomial(b))
        object.__setattr__(self, "a", polynomial(scaled))
        object.__setattr__(self, "delay", whole_number(self.delay, "delay", least=0))

    @property
    def poles(self) -> np.ndarray:
        """Poles away from the origin, by decreasing magnitude."""
        return _sorted_roots(self.a)

    @property
    def zeros(self) -> np.ndarray:
        """Finite zeros away from the origin, by decreasing magnitude."""
        return _sorted_roots(self.b)

    @property
    def numerator(self) -> np.ndarray:
        """z^-delay b(z^-1) with its leading zeros written out."""
        return shift(self.b, self.delay)

    @property
    def is_stable(self) -> bool:
        """Whether every pole lies inside the unit circle."""
        return bool(np.all(np.abs(self.poles) < 1 - _ON_CIRCLE))

    def to_control(self) -> control.TransferFunction:
        """The same plant as a python-control transfer function in z."""
        length = max(self.numerator.size, self.a.size)
        in_z = [np.pad(p, (0, length - p.size)) for p in (self.numerator, self.a)]
        return control.TransferFunction(*in_z, self.dt)


@dataclass(frozen=True, eq=False)
class NoncausalFilter:
    """z^advance b(z^-1)/a(z^-1): it looks `advance` samples ahead, so only a delay can hold it."""

    b: np.ndarray
    a: np.ndarray
    advance: int

    def __post_init__(self) -> None:
        object.__setattr__(self, "b", polynomial(self.b, "numerator b"))
        object.__setattr__(self, "a", polynomial(self.a, "denominator a"))
        object.__setattr__(self, "advance", whole_number(self.advance, "advance", least=0))


def _sorted_roots(p: np.ndarray) -> np.ndarray:
    roots = np.roots(np.trim_zeros(p, "b"))
    roots = roots[np.argsort(-np.abs(roots), kind="stable")]
    return roots.real if np.all(roots.imag == 0) else roots


def shift(p: np.ndarray, delay: int) -> np.ndarray:
    """z^-delay p(z^-1)."""
    return np.concatenate([np.zeros(delay), p])


def add(*terms: np.ndarray) -> np.ndarray:
    """Sum of polynomials of any lengths."""
    total = np.zeros(max(p.size for p in terms))
    for p in terms:
        total[: p.size] += p
    return total


def multiply(*factors: np.ndarray) -> np.ndarray:
    """Product of polynomials."""
    product = np.ones(1)
    for p in factors:
        product = np.convolve(product, p)
    return product


def turns_round_origin(
    curve: Callable[[np.ndarray], np.ndarray], start: float, stop: float, n: int
) -> float:
    """How often a curve turns round the origin, anticlockwise, as its parameter runs.

    The grid, n points first, is refined until no step turns by more than 1 rad.
    Raises ValueError when the curve holds NaN, or passes the origin too close to tell.
    """
    at = np.linspace(start, stop, n)
    value = curve(at)
    for _ in range(40):
        if value.shape != at.shape or not np.all(np.isfinite(value)):
            raise ValueError("the curve holds NaN or infinity, or not one value for each point")
        turned = np.angle(value[1:] / value[:-1])
        coarse = np.flatnonzero(np.abs(turned) > 1)
        if not coarse.size:
            return float(turned.sum() / (2 * np.pi))
        between = (at[coarse] + at[coarse + 1]) / 2
        at, value = (
            np.insert(old, coarse + 1, new) for old, new in ((at, between), (value, curve(between)))
        )
    raise ValueError(f"the curve passes the origin near {between[0]:.9g}, too close to count")


def evaluate(p: np.ndarray, z: ArrayLike) -> np.ndarray:
    """p(z^-1) at the points z."""
    return np.polynomial.polynomial.polyval(1 / np.asarray(z), p)


def unit_circle(n: int, first: float = 0.0) -> np.ndarray:
    """n points e^(j 2 pi (i + first)/n) round the whole unit circle, by default from z = 1 on."""
    return np.exp(2j * np.pi * (np.arange(n) + first) / n)


def at_frequency(frequency: ArrayLike, dt: float) -> np.ndarray:
    """Points e^(j 2 pi f dt) of the unit circle for frequencies f in Hz."""
    return np.exp(2j * np.pi * np.asarray(frequency, dtype=float) * dt)


def response(plant: Plant | NoncausalFilter, z: ArrayLike) -> np.ndarray:
    """Value of a plant or a noncausal filter at the points z."""
    z = np.asarray(z)
    power = plant.advance if isinstance(plant, NoncausalFilter) else -plant.delay
    return z ** float(power) * evaluate(plant.b, z) / evaluate(plant.a, z)


def zero_order_hold(system: control.StateSpace | control.TransferFunction, dt: float) -> Plant:
    """Sample a continuous single-input single-output plant behind a zero-order hold.

    The numerator comes from the impulse response, which keeps the digits of small leading
    coefficients.
    Raises ValueError when the plant is not continuous, not proper, zero or has several inputs or
    outputs, or dt is not positive.
    """
    dt = real_number(dt, "sampling interval dt", positive=True)
    if not system.issiso():
        raise ValueError(f"{system.ninputs} inputs, {system.noutputs} outputs; pick one of each")
    if not system.isctime():
        raise ValueError(f"the plant is sampled at dt = {system.dt!r}; give a continuous one")
    if isinstance(system, control.TransferFunction):
        num, den = (np.trim_zeros(p[0][0], "f") for p in (system.num, system.den))
        if num.size > den.size:
            raise ValueError(f"numerator degree {num.size - 1} exceeds {den.size - 1}: improper")
    sampled = control.sample_system(control.ss(system), dt, method="zoh")
    a = np.atleast_1d(np.poly(sampled.A)) if sampled.nstates else np.ones(1)
    state, impulse = sampled.B, [sampled.D.item()]
    for _ in range(sampled.nstates):
        impulse.append((sampled.C @ state).item())
        state = sampled.A @ state
    return _from_impulse(np.array(impulse), a, dt)


def interval_integral(system: control.StateSpace, dt: float) -> Plant:
    """From an input held over each interval to the integral of the output over that interval.

    The sum of the results is the integral since the start, so a plant behind an integrator and a
    difference (a moving average, the time that one pitch of a cutter takes) needs no pole at z = 1
    that would have to be cancelled afterwards.  Worked out mode by mode, which keeps the relative
    accuracy of coefficients however small fast poles make them.
    Raises ValueError as `modes` does, and for an output that does not answer.
    """
    dt = real_number(dt, "sampling interval dt", positive=True)
    poles, residues = modes(system)
    moved, area = dt * phi1(poles * dt), dt**2 * phi2(poles * dt)
    direct, decay = np.sum(residues * area), np.exp(poles * dt)
    others = [np.poly(np.delete(decay, j)) for j in range(poles.size)]
    through = (residues * moved**2) @ np.array(others)
    b, a = direct * np.poly(decay) + np.append(0, through), np.poly(decay)
    if not b[0]:
        raise ValueError("the plant is zero: its output does not answer to its input")
    return Plant(b.real, a.real, 1, dt)


def modes(system: control.StateSpace) -> tuple[np.ndarray, np.ndarray]:
    """Poles p and residues r of a continuous system, whose response is the sum of r/(s - p).

    Raises ValueError for several inputs or outputs, a sampled system, a direct path, and poles that
    repeat.
    """
    if not (system.issiso() and system.isctime()) or np.any(system.D):
        raise ValueError("give one input, one output, continuous time and no direct path")
    poles, vectors = np.linalg.eig(system.A)
    if not poles.size or np.linalg.cond(vectors) > 1e12:
        raise ValueError(f"poles {poles}: only distinct ones can be taken mode by mode")
    return poles, (system.C @ vectors)[0] * np.linalg.solve(vectors, system.B)[:, 0]


def phi1(x: np.ndarray) -> np.ndarray:
    """(e^x - 1)/x, and 1 at x = 0; the mean of e^(x t) over 0 <= t <= 1."""
    safe = np.where(x == 0, 1, x)
    return np.where(x == 0, 1, np.expm1(safe) / safe)


def phi2(x: np.ndarray) -> np.ndarray:
    """(e^x - 1 - x)/x^2, and 1/2 at x = 0; by its series where the difference loses digits."""
    safe = np.where(np.abs(x) < 1e-2, 1, x)
    series = (1 + x / 3 * (1 + x / 4 * (1 + x / 5 * (1 + x / 6)))) / 2
    return np.where(np.abs(x) < 1e-2, series, (np.expm1(safe) - safe) / safe**2)


def _from_impulse(impulse: np.ndarray, a: np.ndarray, dt: float) -> Plant:
    b = np.convolve(a, impulse)[: a.size]
    if not b.any():
        raise ValueError("the plant is zero: its output does not answer to its input")
    delay = int(np.flatnonzero(b)[0])
    return Plant(b[delay:], a, delay, dt)


def split_zeros(b: ArrayLike, radius: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
    """Split b = B+ B-, B- monic with the zeros of magnitude `radius` or more.

    Zeros on the unit circle, or inside it by less than 1e-4, go to B- whenever radius <= 1.
    Raises ValueError when b begins with 0, the radius is not positive, or it is so large that
    zeros on or outside the unit circle would stay in B+ and be cancelled.
    """
    b = polynomial(b, "numerator b")
    if b[0] == 0:
        raise ValueError(f"b = {b} begins with 0; drop it and count it as delay")
    radius = real_number(radius, "radius", positive=True)
    zeros = np.roots(b)
    kept = np.abs(zeros) >= radius - _NEAR_CIRCLE
    cancelled = zeros[~kept]
    if np.any(np.abs(cancelled) >= 1 - _NEAR_CIRCLE):
        raise ValueError(
            f"radius = {radius!r} would cancel the zeros "
            f"{cancelled[np.abs(cancelled) >= 1 - _NEAR_CIRCLE]} "
            "on or outside the unit circle; choose a radius of 1 or less"
        )
    b_plus = b[0] * np.atleast_1d(np.poly(cancelled)).real
    return b_plus, np.atleast_1d(np.poly(zeros[kept])).real


def zero_phase_inverse(
    plant: Plant,
    radius: float = 1.0,
    normalisation: str = "peak",
    cancel_unstable: bool = False,
) -> NoncausalFilter:
    """Inverse C = z^delay A(z^-1) B-(z) / (b B+(z^-1)), so that plant * C = |B-|^2 / b >= 0.

    B- holds the zeros of magnitude `radius` or more; b is the peak of |B-|^2 over the unit circle
    ("peak", which keeps 0 <= plant * C <= 1), its value at z = 1 ("dc"), or the square of the sum
    of absolute values of B- ("l1", never below the peak).  `cancel_unstable` inverts the model of
    an unstable plant as well, which is of use only where the plant itself is another, stable one.
    Source: Tomizuka (1987); Horng (1989), eqs 15 and 18-20.
    Raises ValueError for an unstable plant, an unknown normalisation, a B- that vanishes at z = 1
    under "dc", and zeros on or outside the unit circle left to be cancelled.
    """
    if not (plant.is_stable or cancel_unstable):
        raise ValueError(
            f"the plant has a pole of magnitude {np.abs(plant.poles).max():.6g}, and an inverse "
            "would cancel it; stabilise the plant first (for example by PI control)"
        )
    b_plus, b_minus = split_zeros(plant.b, radius)
    b = _normaliser(b_minus, normalisation)
    return NoncausalFilter(
        b=multiply(plant.a, b_minus[::-1]) / b,
        a=b_plus,
        advance=plant.delay + b_minus.size - 1,
    )


def _normaliser(b_minus: np.ndarray, normalisation: str) -> float:
    if normalisation == "l1":
        return float(np.abs(b_minus).sum() ** 2)
    if normalisation == "dc":
        dc = float(b_minus.sum() ** 2)
        if dc < 1e-12 * np.abs(b_minus).sum() ** 2:
            raise ValueError("B- vanishes at z = 1, so 'dc' divides by zero; use 'peak' or 'l1'")
        return dc
    if normalisation == "peak":
        return _peak_square(b_minus)
    raise ValueError(f"normalisation {normalisation!r} is none of {', '.join(NORMALISATIONS)}")


def _peak_square(p: np.ndarray) -> float:
    """Exact maximum of |p|^2 over the unit circle, from the stationary points of a cosine sum."""
    r = np.correlate(p, p, "full")[p.size - 1 :]
    cosines = np.polynomial.chebyshev.Chebyshev(np.concatenate([r[:1], 2 * r[1:]]))
    inner = cosines.deriv().roots() if p.size > 2 else np.zeros(0)
    x = np.concatenate([[-1.0, 1.0], np.clip(np.real(inner), -1, 1)])
    return float(cosines(x).max())


def symmetric_fir(half: Sequence[float]) -> np.ndarray:
    """Taps of the zero-phase filter h0 + h1 (z + z^-1) + h2 (z^2 + z^-2) + ... from [h0, h1, ...].

    A Q filter of a repetitive loop has this form; its gain at z = 1 is h0 + 2 (h1 + h2 + ...).
    """
    half = polynomial(half, "half of a symmetric filter")
    return np.concatenate([half[:0:-1], half])


def binomial_q(passes: int = 1) -> np.ndarray:
    """Taps of the low-pass ((z + 2 + z^-1)/4)^passes, with gain 1 at z = 1 and 0 at z = -1."""
    taps = np.ones(1)
    for _ in range(whole_number(passes, "passes", least=0)):
        taps = np.convolve(taps, [0.25, 0.5, 0.25])
    return taps


def zero_phase_gain(taps: ArrayLike, z: ArrayLike) -> np.ndarray:
    """Real gain of a symmetric filter, given by all its taps, at points z of the unit circle."""
    taps = odd_symmetric(taps)
    z = np.asarray(z)
    return (z ** float(taps.size // 2) * evaluate(taps, z)).real


def odd_symmetric(taps: ArrayLike) -> np.ndarray:
    """Coerce to a symmetric filter with a middle tap.

    Raises ValueError when the number of taps is even or the two halves differ by more than
    rounding.
    """
    taps = polynomial(taps, "Q filter")
    if taps.size % 2 == 0 or not np.allclose(taps, taps[::-1], rtol=0, atol=1e-12):
        raise ValueError(
            f"Q filter {taps} must be symmetric about a middle tap; see zdomain.symmetric_fir"
        )
    return polynomial((taps + taps[::-1]) / 2)
