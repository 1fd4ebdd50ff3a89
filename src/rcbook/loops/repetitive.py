"""The repetitive loop: a zero-phase inverse inside a delay of one period, round a process.

Signals, with the symbols used throughout::

    r -(+)-> e -> k_r q z^-N C/(1 - q z^-N) -> u -(+)-> controller -> v -(+ w)-> plant -> y
        -^                                          -^                                     |
         |-------------------------------------------|-------------(+ noise)---------------|

r reference, e error, u reference of the inner loop, v command to the plant, w disturbance at the
plant input, y output.  In a *cascade* u is what the repetitive controller makes of e; in the
*plug-in* form r is added to it, and u (with its limit) is the sum.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import scipy.optimize
import scipy.signal
from numpy.typing import ArrayLike

from rcbook import zdomain
from rcbook.signals import signal
from rcbook.zdomain import NoncausalFilter, Plant, add, multiply, shift

FORMS = ("cascade", "plug-in")
SOURCES = ("reference", "disturbance", "noise")
OUTPUTS = ("output", "command", "repetitive", "error")
_MARGINAL = 1e-9  # spectral radii this close to one are called marginal


@dataclass(frozen=True)
class Process:
    """A plant, by itself or under unity feedback through a controller of zero delay."""

    plant: Plant
    controller: Plant | None = None

    def __post_init__(self) -> None:
        if self.plant.delay < 1:
            raise ValueError(
                f"delay = {self.plant.delay}: the plant answers at once, an algebraic loop; "
                "give it one step of delay"
            )
        if self.controller is None:
            return
        if self.controller.delay != 0:
            raise ValueError(f"controller delay {self.controller.delay}: put it into its b instead")
        if not np.isclose(self.controller.dt, self.plant.dt, rtol=1e-9, atol=0):
            raise ValueError(
                f"controller at {self.controller.dt} s, plant at {self.plant.dt} s; "
                "sample both at the same interval"
            )

    @property
    def command_path(self) -> Plant:
        """From command to output; under feedback the closed loop, nothing cancelled."""
        n, c, feedback = self._parts()
        forward = multiply(shift(self.plant.b, self.plant.delay), n)
        denominator = add(multiply(c, self.plant.a), feedback * forward)
        return Plant(multiply(n, self.plant.b), denominator, self.plant.delay, self.plant.dt)

    @property
    def disturbance_path(self) -> Plant:
        """From a disturbance at the plant input to the output."""
        _, c, _ = self._parts()
        path = self.command_path
        return Plant(multiply(c, self.plant.b), path.a, path.delay, path.dt)

    def _parts(self) -> tuple[np.ndarray, np.ndarray, int]:
        if self.controller is None:
            return np.ones(1), np.ones(1), 0
        return self.controller.b, self.controller.a, 1


def pi_controller(gain: float, alpha: float, dt: float) -> Plant:
    """PI controller gain (1 + alpha z^-1/(1 - z^-1)); alpha gain is the integral gain per sample.

    Source: Horng (1989), eqs 9-10.  Raises ValueError for a gain of zero, or one not finite.
    """
    gain, alpha = zdomain.real_number(gain, "gain"), zdomain.real_number(alpha, "alpha")
    if gain == 0:
        raise ValueError("gain = 0: a controller that does nothing; leave it out")
    return Plant([gain, gain * (alpha - 1)], [1.0, -1.0], 0, dt)


@dataclass(frozen=True, eq=False)
class RepetitiveController:
    """gain q z^-N C/(1 - q z^-N): period N in samples, compensator C, symmetric Q filter q.

    The look-ahead of C and of q must fit into the period: N - advance - q half-width >= 0.
    Raises ValueError when it does not, for a period that is not a positive whole number, a gain
    that is not positive and finite, and a Q filter that is not symmetric.
    """

    compensator: NoncausalFilter
    period: int
    gain: float
    q: np.ndarray = field(default_factory=lambda: np.ones(1))

    def __post_init__(self) -> None:
        mend = "choose a sampling rate that divides the turn evenly"
        object.__setattr__(self, "period", zdomain.whole_number(self.period, "period", 1, mend))
        object.__setattr__(self, "q", zdomain.odd_symmetric(self.q))
        gain = zdomain.real_number(self.gain, "repetitive gain", positive=True)
        object.__setattr__(self, "gain", gain)
        if self.delay < 0 or self.period <= self.q.size // 2:
            raise ValueError(
                f"compensator and Q filter look {self.period - self.delay} samples ahead and the "
                f"memory needs one of its own, more than the period of {self.period} holds; "
                "lengthen the period or shorten q"
            )

    @property
    def delay(self) -> int:
        """Samples of delay left in front of the compensator once its look-ahead is paid for."""
        return self.period - self.compensator.advance - self.q.size // 2

    @property
    def numerator(self) -> np.ndarray:
        """Causal numerator, polynomial in z^-1."""
        return self.gain * shift(multiply(self.q, self.compensator.b), self.delay)

    @property
    def denominator(self) -> np.ndarray:
        """Causal denominator, polynomial in z^-1: the compensator's times 1 - q z^-N."""
        return multiply(self.compensator.a, self.generator)

    @property
    def generator(self) -> np.ndarray:
        """1 - q z^-N, which vanishes at every harmonic of the period when q = 1."""
        return add(np.ones(1), -shift(self.q, self.period - self.q.size // 2))


@dataclass(frozen=True)
class Loop:
    """A process with a repetitive controller round it or, without one, fed by the reference.

    Design the compensator on one process and put another one here to study mismatch.
    """

    process: Process
    repetitive: RepetitiveController | None = None
    form: str = "cascade"

    def __post_init__(self) -> None:
        if self.form not in FORMS:
            raise ValueError(f"form {self.form!r} is none of {', '.join(FORMS)}")

    @property
    def dt(self) -> float:
        return self.process.plant.dt

    def with_gain(self, gain: float) -> Loop:
        """The same loop at another repetitive gain.  Raises ValueError when it has none."""
        if self.repetitive is None:
            raise ValueError("the loop has no repetitive controller; make one with `design`")
        return replace(self, repetitive=replace(self.repetitive, gain=gain))

    def _generator_parts(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """ng, dg and through of u = (through r + ng e)/dg."""
        if self.repetitive is None:
            return np.zeros(1), np.ones(1), np.ones(1)
        numerator, denominator = self.repetitive.numerator, self.repetitive.denominator
        return numerator, denominator, denominator * (self.form == "plug-in")


def design(
    process: Process,
    period: int,
    gain: float,
    q: ArrayLike = (1.0,),
    radius: float = 1.0,
    normalisation: str = "peak",
    form: str = "cascade",
) -> Loop:
    """The repetitive loop whose compensator is the zero-phase inverse of the process itself.

    Source: Horng (1989), eqs 15 and 18.  Raises ValueError as `zdomain.zero_phase_inverse` and
    `RepetitiveController` do.
    """
    inverse = zdomain.zero_phase_inverse(process.command_path, radius, normalisation)
    return Loop(process, RepetitiveController(inverse, period, gain, q), form)


def characteristic_polynomial(loop: Loop) -> np.ndarray:
    """Exact closed-loop polynomial in z^-1, every mode of process and controller kept."""
    ng, dg, _ = loop._generator_parts()
    path = loop.process.command_path
    return add(multiply(path.a, dg), multiply(path.numerator, ng))


@dataclass(frozen=True, eq=False)
class Stability:
    """Closed-loop roots by decreasing magnitude and what follows from the largest."""

    roots: np.ndarray
    spectral_radius: float
    verdict: str  # "stable", "marginal" or "unstable"


def stability(loop: Loop) -> Stability:
    """Roots of the characteristic polynomial; within 1e-9 of the unit circle is "marginal".

    The roots come from exact coefficients, never from a rebuilt transfer function; that holds for
    periods up to some thousand samples.
    """
    roots = np.roots(np.trim_zeros(characteristic_polynomial(loop), "b"))
    roots = roots[np.argsort(-np.abs(roots), kind="stable")]
    radius = float(np.abs(roots[0])) if roots.size else 0.0
    verdict = "stable" if radius < 1 - _MARGINAL else "unstable"
    return Stability(roots, radius, "marginal" if abs(radius - 1) <= _MARGINAL else verdict)


def require_stable(loop: Loop) -> None:
    """Raise ValueError, naming spectral radius and stable gains, unless the loop is stable."""
    found = stability(loop)
    if found.verdict == "stable":
        return
    mend = "stabilise the process"
    if loop.repetitive is not None:
        ranges = [f"{low:.6g} to {high:.6g}" for low, high in stable_gains(loop)]
        at = f"the loop at repetitive gain {loop.repetitive.gain!r}"
        mend = f"choose a gain within {' or '.join(ranges)}" if ranges else "no gain is stable"
    else:
        at = "the loop"
    raise ValueError(
        f"{at} is {found.verdict} (spectral radius {found.spectral_radius:.9g}): "
        f"it has no steady state; {mend}"
    )


def stable_gains(loop: Loop, highest: float = 100.0) -> list[tuple[float, float]]:
    """Every interval of repetitive gains up to `highest` in which the loop is stable.

    Gains that put a root on the unit circle satisfy Im(n(z) conj(d(z))) = 0 there, an algebraic
    equation in z whose roots are found; a gain from each interval between them is then tested.
    Raises ValueError when the loop has no repetitive controller.
    """
    highest = zdomain.real_number(highest, "highest", positive=True)
    unit = loop.with_gain(1.0)
    ng, dg, _ = unit._generator_parts()
    path = unit.process.command_path
    d, n = multiply(path.a, dg), multiply(path.numerator, ng)
    length = max(d.size, n.size)
    d, n = (np.pad(p, (0, length - p.size)) for p in (d, n))
    crossing = np.convolve(d, n[::-1]) - np.convolve(n, d[::-1])
    # On the unit circle coefficients below rounding do not count, as leading ones they mislead.
    crossing[np.abs(crossing) < 1e-18 * np.abs(crossing).max()] = 0
    crossings = np.roots(crossing)
    z = crossings[np.abs(np.abs(crossings) - 1) < 1e-4]
    z = np.append(z / np.abs(z), [1.0, -1.0])
    with np.errstate(divide="ignore", invalid="ignore"):
        gains = -(zdomain.evaluate(d, z) / zdomain.evaluate(n, z)).real
    gains = np.unique(gains[np.isfinite(gains) & (gains > 0) & (gains < highest)])
    edges = np.concatenate([[0.0], gains, [highest]])
    edges = edges[np.append(True, np.diff(edges) > 1e-9)]
    stable = [_radius_at(loop, k) < 1 - _MARGINAL for k in (edges[:-1] + edges[1:]) / 2]
    return _merge(loop, edges, stable)


def _merge(loop: Loop, edges: np.ndarray, stable: Sequence[bool]) -> list[tuple[float, float]]:
    """Join neighbouring stable intervals, where the circle is touched and not crossed."""
    intervals: list[list[float]] = []
    for low, high, good in zip(edges[:-1], edges[1:], stable, strict=True):
        if good and intervals and intervals[-1][1] == low and _radius_at(loop, low) < 1 - _MARGINAL:
            intervals[-1][1] = float(high)
        elif good:
            intervals.append([float(low), float(high)])
    return [(low, high) for low, high in intervals]


def _radius_at(loop: Loop, gain: float) -> float:
    return stability(loop.with_gain(gain)).spectral_radius


def gain_limit(loop: Loop) -> float:
    """Largest gain up to which the loop is stable from zero on; 0 when small gains are unstable.

    A result of 100 means that the search of `stable_gains` found no end.
    """
    intervals = stable_gains(loop)
    return intervals[0][1] if intervals and intervals[0][0] == 0 else 0.0


def transfer(loop: Loop, source: str, output: str) -> tuple[np.ndarray, np.ndarray]:
    """Numerator and denominator, in z^-1, from a source to an output of the closed loop.

    Sources are reference, disturbance (at the plant input) and noise (on the measured output);
    outputs are output, command, repetitive and error (reference minus measured output).
    """
    if source not in SOURCES or output not in OUTPUTS:
        raise ValueError(f"{source!r} to {output!r}: sources {SOURCES}, outputs {OUTPUTS}")
    plant, path = loop.process.plant, loop.process.command_path
    n, c, feedback = loop.process._parts()
    ng, dg, through = loop._generator_parts()
    b = plant.numerator
    delta = characteristic_polynomial(loop)
    reference = add(through, ng)
    both = add(ng, feedback * dg)
    numerators: Mapping[tuple[str, str], np.ndarray] = {
        ("reference", "output"): multiply(b, n, reference),
        ("disturbance", "output"): multiply(b, c, dg),
        ("noise", "output"): -multiply(b, n, both),
        ("reference", "command"): multiply(n, plant.a, reference),
        ("disturbance", "command"): -multiply(b, n, both),
        ("noise", "command"): -multiply(n, plant.a, both),
        ("reference", "repetitive"): multiply(path.a, reference),
        ("disturbance", "repetitive"): -multiply(b, c, ng),
        ("noise", "repetitive"): -multiply(c, plant.a, ng),
    }
    if output != "error":
        return numerators[source, output], delta
    measured = -numerators[source, "output"]
    direct = {"reference": delta, "disturbance": np.zeros(1), "noise": -delta}[source]
    return add(direct, measured), delta


def unstable_roots(
    repetitive: RepetitiveController, plant: Callable[[np.ndarray], np.ndarray]
) -> int:
    """Closed-loop roots outside the unit circle, counted from the plant's frequency response.

    `plant` gives the response, model or measurement, of a real and stable plant at an array of
    points z of the upper half of the circle.  The roots are zeros of 1 - q z^-N (1 - k_r C G):
    its turns round the origin are counted, on a grid that is refined until no step turns by more
    than 1 rad.
    Raises ValueError when a root lies on the circle, or too close to tell.
    """

    def around(angle: np.ndarray) -> np.ndarray:
        z, response = np.exp(1j * angle), np.asarray(plant(np.exp(1j * angle)))
        if response.shape != z.shape:
            raise ValueError(f"plant(z) has shape {response.shape} for {z.size} points z")
        return 1 - regeneration(repetitive, response, z) * z ** float(-repetitive.period)

    # The ends, next to z = 1 and z = -1, are closed by their mirror images.
    inset = np.pi * 1e-6
    turned = zdomain.turns_round_origin(around, inset, np.pi - inset, 16 * repetitive.period)
    first, last = around(np.array([inset, np.pi - inset]))
    closing = np.angle(first / first.conj()) + np.angle(last.conj() / last)
    return -round(2 * turned + closing / (2 * np.pi))


def regeneration(repetitive: RepetitiveController, response: ArrayLike, z: ArrayLike) -> np.ndarray:
    """Factor q (1 - k_r C G) from one period to the next at points z, for a plant response G.

    Below one in magnitude everywhere it makes the loop stable whatever the period.
    """
    compensated = zdomain.response(repetitive.compensator, z) * np.asarray(response)
    return zdomain.zero_phase_gain(repetitive.q, z) * (1 - repetitive.gain * compensated)


@dataclass(frozen=True)
class Limit:
    """A symmetric limit on a signal, and whether its recursion goes on from the clipped value."""

    value: float = np.inf
    remember_clipped: bool = True

    def __post_init__(self) -> None:
        if not self.value > 0:
            raise ValueError(f"limit {self.value!r} must be positive")


@dataclass(frozen=True, eq=False)
class Run:
    """Signals of one simulation, each of n samples, in the units of the plant."""

    dt: float  # s
    reference: np.ndarray
    disturbance: np.ndarray
    output: np.ndarray
    command: np.ndarray
    repetitive: np.ndarray
    error: np.ndarray  # reference minus measured output
    inner_error: np.ndarray  # repetitive minus measured output
    command_clipped: int = 0  # samples at which the limit on the command acted
    repetitive_clipped: int = 0

    @property
    def time(self) -> np.ndarray:
        """Sampling instants in s."""
        return self.dt * np.arange(self.output.size)


def simulate(
    loop: Loop,
    reference: ArrayLike,
    disturbance: ArrayLike | None = None,
    noise: ArrayLike | None = None,
    command_limit: Limit = Limit(),
    repetitive_limit: Limit = Limit(),
) -> Run:
    """Run the loop sample by sample from rest, limits included.

    Source: Horng (1989), eqs 24-28 with eq. 25 corrected.
    Raises ValueError when the signals differ in length or hold NaN.
    """
    r, w, noise = _inputs(reference, disturbance, noise)
    n, c, feedback = loop.process._parts()
    ng, dg, through = loop._generator_parts()
    b, a = loop.process.plant.numerator, loop.process.plant.a
    keep_u, keep_v = repetitive_limit.remember_clipped, command_limit.remember_clipped
    lags = max(p.size for p in (ng, dg, through, a, b, n, c)) - 1
    y, e, u, v, inner, sent, memory_u, memory_v = np.zeros((8, lags + r.size))
    wanted_u, wanted_v = np.zeros((2, lags + r.size))
    past_r, past_w = (np.concatenate([np.zeros(lags), s]) for s in (r, w))

    def recall(p: np.ndarray, s: np.ndarray, k: int, first: int = 0) -> float:
        return p[first:] @ s[k - p.size + 1 : k - first + 1][::-1]

    for k in range(lags, lags + r.size):
        y[k] = recall(b, sent, k) - recall(a, y, k, 1)
        measured = y[k] + noise[k - lags]
        e[k] = past_r[k] - measured
        wanted = recall(ng, e, k) + recall(through, past_r, k) - recall(dg, memory_u, k, 1)
        wanted_u[k] = wanted / dg[0]
        u[k] = np.clip(wanted_u[k], -repetitive_limit.value, repetitive_limit.value)
        inner[k] = u[k] - feedback * measured
        wanted_v[k] = (recall(n, inner, k) - recall(c, memory_v, k, 1)) / c[0]
        v[k] = np.clip(wanted_v[k], -command_limit.value, command_limit.value)
        memory_u[k] = u[k] if keep_u else wanted_u[k]
        memory_v[k] = v[k] if keep_v else wanted_v[k]
        sent[k] = v[k] + past_w[k]
    y, e, u, v = (s[lags:] for s in (y, e, u, v))
    limited = ((wanted_v[lags:], command_limit), (wanted_u[lags:], repetitive_limit))
    acted = [int(np.sum(np.abs(s) > limit.value)) for s, limit in limited]
    return Run(loop.dt, r, w, y, v, u, e, u - (y + noise), *acted)


def _inputs(reference: ArrayLike, disturbance, noise) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    r = signal(reference, "reference")
    w, noise = (
        np.zeros(r.size) if s is None else signal(s, name, r.size)
        for s, name in ((disturbance, "disturbance"), (noise, "noise"))
    )
    return r, w, noise


def respond(
    loop: Loop,
    reference: ArrayLike,
    disturbance: ArrayLike | None = None,
    noise: ArrayLike | None = None,
) -> Run:
    """The same run as `simulate` without limits, by filtering through the closed-loop transfers."""
    r, w, noise = _inputs(reference, disturbance, noise)
    y, v, u, e = (
        sum(
            scipy.signal.lfilter(*transfer(loop, source, output), s)
            for source, s in zip(SOURCES, (r, w, noise), strict=True)
        )
        for output in OUTPUTS
    )
    return Run(loop.dt, r, w, y, v, u, e, u - (y + noise))


def steady_state(loop: Loop, reference: ArrayLike, disturbance: ArrayLike) -> Run:
    """One period of the steady state, computed harmonic by harmonic and not by waiting for it.

    `reference` and `disturbance` hold one period each, N samples.
    Raises ValueError when the loop is not stable, because then there is none, and when the
    lengths are not the period of the repetitive controller.
    """
    period = None if loop.repetitive is None else loop.repetitive.period
    r = signal(reference, "one period of the reference", period)
    w = signal(disturbance, "one period of the disturbance", r.size)
    require_stable(loop)
    z = zdomain.unit_circle(r.size)
    spectra = {"reference": np.fft.fft(r), "disturbance": np.fft.fft(w)}
    y, v, u, e = (
        np.fft.ifft(
            sum(_value(transfer(loop, source, output), z) * s for source, s in spectra.items())
        ).real
        for output in OUTPUTS
    )
    return Run(loop.dt, r, w, y, v, u, e, u - y)


def _value(fraction: tuple[np.ndarray, np.ndarray], z: np.ndarray) -> np.ndarray:
    numerator, denominator = fraction
    return zdomain.evaluate(numerator, z) / zdomain.evaluate(denominator, z)


def frequency_response(loop: Loop, source: str, output: str, frequency: ArrayLike) -> np.ndarray:
    """Complex response from a source to an output at frequencies in Hz."""
    frequency = signal(np.ravel(frequency), "frequency").reshape(np.shape(frequency))
    return _value(transfer(loop, source, output), zdomain.at_frequency(frequency, loop.dt))


def sensitivity(loop: Loop, frequency: ArrayLike) -> np.ndarray:
    """Complex sensitivity, measured output over a disturbance added to the output, at f in Hz."""
    return -frequency_response(loop, "noise", "error", frequency)


def noise_gain(loop: Loop, output: str = "output") -> float:
    """Standard deviation of an output per unit standard deviation of white measurement noise.

    The mean of |transfer|^2 over n points of the circle is exact but for terms of the size
    spectral_radius^n, and n is chosen to bring these below rounding.
    Raises ValueError when the loop is not stable.
    """
    require_stable(loop)
    radius = max(stability(loop).spectral_radius, 0.5)
    n = int(np.ceil(np.log(1e-17) / np.log(radius))) + characteristic_polynomial(loop).size
    if n > 5_000_000:
        raise ValueError(
            f"spectral radius {radius:.9g} is too near 1 to sum the response; raise the gain"
        )
    numerator, denominator = (np.fft.fft(p, n) for p in transfer(loop, "noise", output))
    return float(np.sqrt(np.mean(np.abs(numerator / denominator) ** 2)))
