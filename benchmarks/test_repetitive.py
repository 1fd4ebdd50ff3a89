"""What questions about a repetitive loop cost, beside python-control, a filter and a few lines."""

from __future__ import annotations

from dataclasses import replace

import control
import numpy as np
import pytest
import scipy.signal

from rcbook.loops import repetitive
from rcbook.loops.repetitive import Limit, Limits, Loop
from rcbook.zdomain import Plant, binomial_q

ZEROS, POLES = [1.3, 0.6, 0.4, -0.3, -0.5], [0.9, 0.7, 0.5, 0.3, -0.2, -0.4]
PLANTS = {
    2: Plant([0.4, 0.2], [1, -1.2, 0.5], 1, 1e-3),
    6: Plant(0.2 * np.poly(ZEROS), np.poly(POLES), 1, 1e-3),
}
PERIODS = (8, 32, 128, 1200)


def loop_of(order: int, period: int, gain: float = 0.7) -> Loop:
    """A plant by itself, and a repetitive controller with a q of three taps plugged in."""
    memory = repetitive.plain(period, binomial_q(1))
    return repetitive.design(PLANTS[order], memory, gain, form="plug-in")


def signals(period: int, least: int = 10_000) -> tuple[np.ndarray, np.ndarray]:
    """Reference and disturbance: whole periods, four or more."""
    t = 2 * np.pi * np.arange(max(least // period, 4) * period) / period
    return np.sin(t) + 0.5 * np.sin(2 * t), 0.3 * np.sin(3 * t)


def acting_limits(loop: Loop, r: np.ndarray, w: np.ndarray) -> Limits:
    """Limits that both act in every period, at a tenth of the samples or so."""
    free = repetitive.simulate(loop, r, disturbance=w)
    command, repeat = (np.abs(s[-round(loop.period) :]) for s in (free.command, free.repetitive))
    return Limits(Limit(0.9 * command.max()), Limit(0.93 * repeat.max()))


def by_hand(loop: Loop, r: np.ndarray, w: np.ndarray, limits: Limits) -> list[float]:
    """The recursion as one would write it: on lists, and only coefficients that are not 0."""
    plant, rc, most = loop.process.plant, loop.repetitive, limits.repetitive.value
    b, a, num, den = (
        [(i, c) for i, c in enumerate(p.tolist()) if c]
        for p in (plant.numerator, plant.a, rc.numerator, rc.denominator)
    )
    before, command = max(rc.denominator.size, rc.numerator.size), limits.command.value
    r, w = [0.0] * before + r.tolist(), [0.0] * before + w.tolist()
    y, e, p, u, x = ([0.0] * len(r) for _ in range(5))
    for k in range(before, len(r)):
        y[k] = sum([c * x[k - i] for i, c in b]) - sum([c * y[k - i] for i, c in a[1:]])
        e[k] = r[k] - y[k]
        p[k] = sum([c * e[k - i] for i, c in num]) - sum([c * p[k - i] for i, c in den[1:]])
        u[k] = max(-most, min(most, r[k] + p[k] / den[0][1]))
        p[k] = u[k] - r[k]
        x[k] = max(-command, min(command, u[k])) + w[k]
    return y[before:]


def connected(loop: Loop) -> control.StateSpace:
    """Reference to output of the closed loop, blocks connected and not multiplied out."""

    def block(num: np.ndarray, den: np.ndarray) -> control.StateSpace:
        size = max(num.size, den.size)
        num, den = (np.pad(p, (0, size - p.size)) for p in (num, den))
        return control.ss(control.tf(np.trim_zeros(num, "f"), den, loop.dt))

    rc, plant = loop.repetitive, loop.process.plant
    return control.feedback(block(plant.numerator, plant.a) * block(rc.numerator, rc.denominator))


@pytest.mark.parametrize("period", PERIODS)
@pytest.mark.parametrize("order", PLANTS)
def test_run_with_limits(row, order, period):
    loop, (r, w) = loop_of(order, period), signals(period)
    limits = acting_limits(loop, r, w)
    run = repetitive.simulate(loop, r, disturbance=w, limits=limits)
    assert np.allclose(run.output, by_hand(loop, r, w, limits), rtol=0, atol=1e-11)
    assert min(run.command_clipped, run.repetitive_clipped) > 0.005 * r.size
    row.faster(
        lambda: repetitive.simulate(loop, r, disturbance=w, limits=limits),
        lambda: by_hand(loop, r, w, limits),
        {8: 1, 32: 5, 128: 10, 1200: 20}[period],
        question=f"run with limits, plant order {order}, N = {period}",
        against="the recursion on lists, by hand",
    )


@pytest.mark.parametrize("period", PERIODS)
def test_linear_response(row, period):
    loop, (r, _) = (
        replace(loop_of(6, period), form="cascade"),
        signals(period, 2400 if period == 1200 else 10_000),
    )
    system, t = connected(loop), loop.dt * np.arange(r.size)
    theirs = control.forced_response(system, t[:600], r[:600]).outputs
    assert np.allclose(repetitive.respond(loop, r).output[:600], theirs, rtol=0, atol=1e-8)
    row.faster(
        lambda: repetitive.respond(loop, r),
        lambda: control.forced_response(system, t, r),
        70 if period == 128 else 100,
        rounds=3 if period == 1200 else 7,
        question=f"linear response, plant order 6, N = {period}",
        against="control.forced_response",
    )


@pytest.mark.parametrize("period", [*PERIODS, 10_000, 100_000])
def test_linear_response_over_a_filter(row, period):
    loop, (r, w) = loop_of(6, period), signals(period)
    plant = loop.process.plant
    row.floors(
        lambda: repetitive.respond(loop, r, disturbance=w),
        lambda: scipy.signal.lfilter(plant.numerator, plant.a, r),
        20 if period == 128 else 15,
        question=f"linear response, plant order 6, N = {period}",
        against="scipy.signal.lfilter on the plant alone",
    )


@pytest.mark.parametrize("limited", [False, True], ids=["linear", "limits"])
def test_a_sample_costs_the_same_at_any_period(row, limited):
    def make(period):
        loop, (r, w) = loop_of(6, period), signals(period, 400_000)
        limits = acting_limits(loop, r, w) if limited else Limits()
        return lambda: repetitive.simulate(loop, r, disturbance=w, limits=limits)

    row.growth(
        (1000, 10_000, 100_000),
        make,
        0.1,
        question=f"run {'with limits' if limited else 'without limits'}, 400 000 samples",
        against="exponent of its time over the period",
    )


@pytest.mark.parametrize("period", [12, 128, 1200])
def test_spectral_radii(row, period):
    """np.roots, which takes long, is asked at a part of the gains."""
    loop = loop_of(2, period)
    d, n = loop.with_gain(1.0).open_polynomials
    d, n = (np.pad(p, (0, max(d.size, n.size) - p.size)) for p in (d, n))
    gains, share = np.linspace(0.05, 3, 1000), {12: 1, 128: 25, 1200: 1000}[period]

    def theirs():
        return [np.abs(np.roots(d + k * n)).max() for k in gains[::share]]

    ours = repetitive.spectral_radii(loop, gains)[::share] ** (1 / period)
    assert np.allclose(ours, theirs(), rtol=1e-10, atol=0)
    row.faster(
        lambda: repetitive.spectral_radii(loop, gains),
        theirs,
        {12: 12, 128: 45, 1200: 1000}[period],
        rounds=3,
        parts=share,
        question=f"stability of 1000 gains, N = {period}",
        against="np.roots at each",
    )


@pytest.mark.parametrize(("period", "goal"), [(300, 0.3), (1200, 1.0), (10_000, 10.0)])
def test_stable_gains(row, period, goal):
    loop = loop_of(6, period)
    row.seconds(
        lambda: repetitive.stable_gains(loop),
        goal,
        question=f"all stable gains, plant order 6, N = {period}",
        against="seconds",
    )
