"""The periodic loop from its definition, sample by sample, without matrices of a period."""

import numpy as np
import scipy.linalg

from rcbook import zdomain
from rcbook.loops import periodic
from rcbook.loops.periodic import Limit
from rcbook.machines import boring_bar

BAR = boring_bar.HANSON_TSAO2000
_FREE = Limit()


def bar_intervals(n, gamma):
    return boring_bar.sinusoidal_intervals(BAR.sampling_interval, gamma, n)


def bar_loop(n, gamma, design="scheduled", q=(1.0,), gain=1.0):
    intervals = bar_intervals(n, gamma)
    designed_for = bar_intervals(n, 0.0) if design == "nominal" else intervals
    compensator = periodic.zero_phase(BAR.plant, designed_for)
    return periodic.PeriodicLoop(
        periodic.sample(BAR.plant, intervals), compensator, periodic.plain(n, q), gain
    )


def by_definition(
    loop, drive, x=None, u=None, w=None, disturbance=None, repetitive=_FREE, command=_FREE
):
    """x, u, w, v as dictionaries of time and y as a row, from the equations at the head of the
    package; u and w map past times to values, zero where they say nothing.  `drive` is r - noise.
    With limits u is what the compensator filters; the memory goes on from it or from what it was
    before it was clipped."""
    plant, n, h = loop.plant, loop.period, loop.memory
    u, w = dict(u or {}), dict(w or {})
    kept, v = dict(u), {}
    x = np.zeros(plant.order) if x is None else x
    states, y = {0: x}, []
    for k, driven in enumerate(drive):
        i = k % n
        y.append(plant.c @ x)
        w[k] = kept.get(k - loop.advance, 0.0) + driven - y[-1]
        wanted = sum(
            tap * w.get(k + loop.advance - h.first - j, 0.0) for j, tap in enumerate(h.taps)
        )
        u[k] = np.clip(wanted, -repetitive.value, repetitive.value)
        kept[k] = u[k] if repetitive.remember_clipped else wanted
        taps = loop.compensator.taps[i]
        v[k] = loop.gain * sum(tap * u.get(k - j, 0.0) for j, tap in enumerate(taps))
        v[k] = np.clip(v[k], -command.value, command.value)
        entering = v[k] + (0.0 if disturbance is None else disturbance[k])
        x = plant.a[i] @ x + plant.b[i] * entering
        states[k + 1] = x
    return states, u, w, v, np.array(y)


def sizes(loop):
    """n, reach and memory of the state as `one_period_map` documents it."""
    reach = max(loop.advance, loop.compensator.taps.shape[1] - 1)
    return loop.plant.order, reach, loop.memory.first - loop.advance + loop.memory.taps.size - 1


def from_state(loop, state, drive):
    order, reach, memory = sizes(loop)
    u = {i - reach: value for i, value in enumerate(state[order : order + reach])}
    w = {i - memory: value for i, value in enumerate(state[order + reach :])}
    return by_definition(loop, drive, state[:order], u, w)


def state_after(loop, x, u, w):
    """State at sample N from what `by_definition` returned."""
    _, reach, memory = sizes(loop)
    n = loop.period
    after = [u.get(j, 0.0) for j in range(n - reach, n)]
    after += [w.get(j, 0.0) for j in range(n - memory, n)]
    return np.concatenate([x[n], after])


def matrix_by_definition(loop):
    columns = []
    for unit in np.eye(sum(sizes(loop))):
        x, u, w, *_ = from_state(loop, unit, np.zeros(loop.period))
        columns.append(state_after(loop, x, u, w))
    return np.array(columns).T


def embeddings(loop):
    """Maps of the state of `one_period_map` to those of eq. 8 and of eq. A14, from definitions."""
    order, _, memory = sizes(loop)
    n, filter = loop.period, loop.compensator.taps.shape[1] - 1
    product, appendix = [], []
    for unit in np.eye(sum(sizes(loop))):
        _, u, w, *_ = from_state(loop, unit, np.zeros(n))
        past_w = [w[-j] for j in range(1, memory + 1)]
        past_u = [u[-j] for j in range(1, max(filter, loop.advance) + 1)]
        x = unit[:order]
        product.append(np.concatenate([past_w, past_u[: loop.advance], past_u[:filter], x]))
        appendix.append(np.concatenate([past_u[:filter], x, [u[k] for k in range(n)]]))
    return np.array(product).T, np.array(appendix).T


def window_of_k(loop, samples, span):
    """Matrix of K on `samples` inputs, with outputs from 9 before to `span` after, from the
    definition: answer of q (u(k) - y(k+L)) to unit inputs."""
    plant, n, taps = loop.plant, loop.period, loop.memory.taps
    half, rows = taps.size // 2, 9 + samples + span
    matrix = np.zeros((rows, samples))
    for j in range(samples):
        y, x = np.zeros(rows + 30), np.zeros(plant.order)
        for k in range(j, rows + 20 - 9):
            y[k + 9] = plant.c @ x
            lag = k - j
            v = loop.taps[k % n, lag] if lag < loop.taps.shape[1] else 0.0
            x = plant.a[k % n] @ x + plant.b[k % n] * v
        inner = -np.roll(y, -loop.advance)
        inner[9 + j] += 1.0
        for k in range(-9, rows - 9):
            terms = range(max(k - half, -9), k + half + 1)
            matrix[k + 9, j] = sum(taps[half + k - i] * inner[i + 9] for i in terms)
    return matrix


def closed_form_modes(n, gain, q):
    """Modes z of the time-invariant loop, z^N = q (1 - gain |B|^2/b), by fixed-point iteration
    from the N-th roots of unity; it contracts like 1/N."""
    b = zdomain.zero_order_hold(periodic.balanced(BAR.plant), BAR.sampling_interval).b
    z = zdomain.unit_circle(n)
    for _ in range(30):
        squared = zdomain.evaluate(b, z) * zdomain.evaluate(b, 1 / z) / np.abs(b).sum() ** 2
        symbol = zdomain.evaluate(q, z) * z ** float(len(q) // 2) * (1 - gain * squared)
        # the symbol is all but real: one branch of the logarithm for each sign, no cut nearby
        logarithm = np.log(np.abs(symbol.real) + 1j * symbol.imag * np.sign(symbol.real))
        logarithm += 1j * np.pi * (symbol.real < 0)
        z = np.exp((logarithm + 2j * np.pi * np.arange(n)) / n)
    return z, symbol


def stationary_variance(loop, output, source):
    """Mean variance over the period per unit of white noise: scipy's Lyapunov equation, matrices
    of one period from the definition."""
    n = loop.period
    sign = {"reference": 1.0, "noise": -1.0, "disturbance": 0.0}[source]

    def answer(unit, state):
        disturbance = unit if source == "disturbance" else None
        order, reach, memory = sizes(loop)
        u = {i - reach: value for i, value in enumerate(state[order : order + reach])}
        w = {i - memory: value for i, value in enumerate(state[order + reach :])}
        x, u, w, v, y = by_definition(loop, sign * unit, state[:order], u, w, disturbance)
        seen = {
            "output": y,
            "repetitive": np.array([v[k] for k in range(n)]),
            "command": np.array([v[k] for k in range(n)]),
            "error": unit * (source == "reference") - y,
            "measured_error": sign * unit - y,
        }[output]
        return state_after(loop, x, u, w), seen

    size = sum(sizes(loop))
    entry, driven = zip(*(answer(unit, np.zeros(size)) for unit in np.eye(n)), strict=True)
    ends, free = zip(*(answer(np.zeros(n), unit) for unit in np.eye(size)), strict=True)
    entry, free, matrix = np.array(entry).T, np.array(free).T, np.array(ends).T
    covariance = scipy.linalg.solve_discrete_lyapunov(matrix, entry @ entry.T)
    return (np.trace(free @ covariance @ free.T) + np.sum(np.square(driven))) / n


def held_one_by_one(system, intervals):
    """a and b of every interval, each by scipy's matrix exponential."""
    system = periodic.balanced(system)
    n, joint = system.nstates, np.zeros((system.nstates + 1,) * 2)
    joint[:n, :n], joint[:n, n] = system.A, system.B[:, 0]
    whole = np.array([scipy.linalg.expm(joint * t)[:n] for t in intervals])
    return whole[:, :, :n], whole[:, :, n]


def output_when_late(system, intervals, delay, command):
    """Output at the samples, stepped from each instant at which an input comes to the next."""
    c, period, at = periodic.balanced(system).C[0], len(intervals), 0.0
    instants = [0.0]
    for k in range(len(command)):
        instants.append(instants[-1] + intervals[k % period])
    samples, arrivals = np.array(instants[:-1]), np.array(instants[:-1]) + delay
    x, found = np.zeros(c.size), []
    for goal in samples:
        for instant in [*arrivals[(arrivals > at) & (arrivals < goal)], goal]:
            come = np.flatnonzero(arrivals <= at)
            (a,), (b,) = held_one_by_one(system, [instant - at])
            x = a @ x + b * (command[come[-1]] if come.size else 0.0)
            at = instant
        found.append(c @ x)
    return np.array(found)


def inverted_one_by_one(system, intervals):
    """Taps of the zero-phase inverse of each interval: hold, roots and inverse one at a time."""
    system = periodic.balanced(system)
    found = []
    for interval in intervals:
        plant = zdomain.zero_order_hold(system, interval)
        each = zdomain.zero_phase_inverse(plant, 1e-9, normalisation="l1")
        found.append(each.b / each.a[0])
    return np.array(found)
