"""The repetitive loop written down again: its definition, its block equations, its polynomials.

Nothing here uses the polynomials or transfer functions of the library, only coefficients.
"""

from itertools import pairwise

import numpy as np
from scipy.signal import lfilter

from rcbook.loops import repetitive
from rcbook.loops.repetitive import Resonators

SIGNALS = ("output", "command", "repetitive")


class Definition:
    """One sample of the loop at a time, from the block diagram.

    The repetitive controller is a store: p(k) = sum of taps times [p + gain C e](k - lag), with C
    reaching ahead of the lag but never of k.  Resonators are the recursion of their fraction.
    """

    def __init__(self, loop):
        plant, inner, rc = loop.process.plant, loop.process.controller, loop.repetitive
        self.loop, self.plant, self.inner, self.rc = loop, plant, inner, rc
        self.lengths = {
            "y": len(plant.a) - 1,
            "x": plant.delay + len(plant.b) - 1,
            "i": 0 if inner is None else len(inner.b) - 1,
            "v": 0 if inner is None else len(inner.a) - 1,
        }
        if isinstance(rc, Resonators):
            self.lengths |= {"e": len(rc.bank) - 1, "p": len(rc.denominator) - 1, "c": 0}
        elif rc is not None:
            longest = rc.memory.first + len(rc.memory.taps) - 1
            self.lengths["e"] = len(rc.compensator.b) - 1
            self.lengths["c"] = max(len(rc.compensator.a) - 1, longest)
            self.lengths["p"] = longest

    def rest(self):
        return {name: [0.0] * n for name, n in self.lengths.items()}

    def step(self, past, r, w, noise):
        """Signals at k and the memory for k + 1; past[name][i - 1] is the value i samples ago."""
        plant, inner = self.plant, self.inner
        y = sum(-plant.a[i] * past["y"][i - 1] for i in range(1, len(plant.a)))
        y += sum(b * past["x"][plant.delay + i - 1] for i, b in enumerate(plant.b))
        e = r - (y + noise)
        c, p = self.controller(past, e)
        u = r if self.rc is None else p + (r if self.loop.form == "plug-in" else 0.0)
        if inner is None:
            i, v = 0.0, u
        else:
            i = u - (y + noise)
            v = inner.b[0] * i + sum(inner.b[j] * past["i"][j - 1] for j in range(1, len(inner.b)))
            v -= sum(inner.a[j] * past["v"][j - 1] for j in range(1, len(inner.a)))
        fresh = {"y": y, "x": v + w, "i": i, "v": v, "e": e, "c": c, "p": p}
        memory = {name: [fresh[name], *past[name]][: len(past[name])] for name in past}
        found = {"output": y, "error": r - y, "measured_error": e, "command": v, "repetitive": u}
        return found, memory

    def controller(self, past, e):
        """c, the compensated error, and p, what the controller sends."""
        rc = self.rc
        if rc is None:
            return 0.0, 0.0
        if isinstance(rc, Resonators):
            p = rc.gain * sum(b * x for b, x in zip(rc.bank, [e, *past["e"]], strict=True))
            return 0.0, p - sum(a * x for a, x in zip(rc.denominator[1:], past["p"], strict=True))
        comp = rc.compensator
        c = comp.b[0] * e
        c += sum(comp.b[i] * past["e"][i - 1] for i in range(1, len(comp.b)))
        c -= sum(comp.a[i] * past["c"][i - 1] for i in range(1, len(comp.a)))
        c /= comp.a[0]
        stored, p = [c, *past["c"]], 0.0
        for lag, tap in enumerate(rc.memory.taps, rc.memory.first):
            p += tap * (past["p"][lag - 1] + rc.gain * stored[lag - comp.advance])
        return c, p

    def run(self, r, w, noise):
        past, out = self.rest(), []
        for sample in zip(r, w, noise, strict=True):
            signals, past = self.step(past, *sample)
            out.append(signals)
        return {name: np.array([s[name] for s in out]) for name in out[0]}

    def state_space(self, outputs):
        """A, B, C, D, column by column from the step itself; inputs r, w, noise."""
        names = list(self.lengths)

        def flat(memory):
            return np.concatenate([np.array(memory[n], dtype=float) for n in names])

        def shaped(x):
            ends = np.cumsum([self.lengths[n] for n in names])
            return {n: list(part) for n, part in zip(names, np.split(x, ends[:-1]), strict=True)}

        size = sum(self.lengths.values())
        columns = [self.step(shaped(x), 0.0, 0.0, 0.0) for x in np.eye(size)]
        inputs = [self.step(self.rest(), *x) for x in np.eye(3)]
        a = np.column_stack([flat(memory) for _, memory in columns])
        b = np.column_stack([flat(memory) for _, memory in inputs])
        c, d = (
            np.array([[s[name] for s, _ in part] for name in outputs]) for part in (columns, inputs)
        )
        return a, b, c, d


def controller_response(rc, z):
    """The controller from e to p at points z, from its coefficients."""

    def at(p):
        return np.polyval(np.asarray(p)[::-1], 1 / z)

    if isinstance(rc, Resonators):
        return rc.gain * at(rc.bank) / at(rc.denominator)
    remembered = sum(tap * z ** -float(rc.memory.first + i) for i, tap in enumerate(rc.memory.taps))
    c = z ** float(rc.compensator.advance) * at(rc.compensator.b) / at(rc.compensator.a)
    return rc.gain * c * remembered / (1 - remembered)


def block_solution(loop, z):
    """y, v, u, e and the measured e for unit r, w, noise at a point z, from the block equations."""
    plant, inner, rc = loop.process.plant, loop.process.controller, loop.repetitive

    def at(p):
        return np.polyval(p[::-1], 1 / z)

    g = z ** (-plant.delay) * at(plant.b) / at(plant.a)
    k = 1.0 if inner is None else at(inner.b) / at(inner.a)
    feedback = 0.0 if inner is None else 1.0
    rep, through = 0.0, 1.0
    if rc is not None:
        rep = controller_response(rc, z)
        through = 1.0 if loop.form == "plug-in" else 0.0
    #                 y            v    u    e  measured e
    matrix = np.array(
        [
            [1, -g, 0, 0, 0],
            [feedback * k, 1, -k, 0, 0],
            [0, 0, 1, 0, -rep],
            [1, 0, 0, 1, 0],
            [1, 0, 0, 0, 1],
        ]
    )
    #                 r        w  noise
    right = np.array(
        [[0, g, 0], [0, 0, -feedback * k], [through, 0, 0], [1, 0, 0], [1, 0, -1]], dtype=complex
    )
    names = ("output", "command", "repetitive", "error", "measured_error")
    return dict(zip(names, np.linalg.solve(matrix, right), strict=True))


def schur_cohn(p):
    """Whether all roots of a polynomial (highest power first) lie inside the circle, by Jury."""
    p = np.trim_zeros(np.array(p, dtype=float), "f")
    while p.size > 1:
        reflection = p[-1] / p[0]
        if abs(reflection) >= 1:
            return False
        p = ((p - reflection * p[::-1]) / (1 - reflection**2))[:-1]
    return True


def outside_by_winding(p, radius=1.0, points=2**14):
    """Roots of z^n p(z^-1) beyond a circle, by the argument principle for x = z^-1."""
    x = np.exp(2j * np.pi * np.arange(points + 1) / points) / radius
    angle = np.unwrap(np.angle(np.polyval(np.asarray(p)[::-1], x)))
    return round((angle[-1] - angle[0]) / (2 * np.pi))


def padded(*polynomials):
    length = max(len(p) for p in polynomials)
    return [np.pad(p, (0, length - len(p))) for p in polynomials]


def controller_polynomials(rc):
    """Denominator and numerator at unit gain, term by term."""
    if isinstance(rc, Resonators):
        return rc.denominator, rc.bank
    taps, first = rc.memory.taps, rc.memory.first
    generator = np.r_[np.zeros(first), -taps]
    generator[0] += 1.0
    ahead = np.r_[np.zeros(first - rc.compensator.advance), taps]
    return np.convolve(generator, rc.compensator.a), np.convolve(ahead, rc.compensator.b)


def open_polynomials(loop):
    """d and n of the characteristic polynomial d + k n, term by term from the block diagram."""
    plant, inner = loop.process.plant, loop.process.controller
    a, b = plant.a, np.r_[np.zeros(plant.delay), plant.b]
    if inner is not None:
        a, b = np.convolve(a, inner.a), np.convolve(b, inner.b)
        a = sum(padded(a, b))
    denominator, numerator = controller_polynomials(loop.repetitive)
    return padded(np.convolve(a, denominator), np.convolve(b, numerator))


def limited(loop, r, w, noise, command, repet):
    """The recursions with clipping, from the definition of `Limit`, on lists."""
    plant, inner, rc = loop.process.plant, loop.process.controller, loop.repetitive
    num, den, through = [0.0], [1.0], [1.0]
    if rc is not None:
        den, num = controller_polynomials(rc)
        num, den = (rc.gain * num).tolist(), den.tolist()
        through = den if loop.form == "plug-in" else [0.0]
    y, e, u, u_mem, i, v, v_mem = ([] for _ in range(7))
    acted = [0, 0]

    def past(p, s, k, first):
        return sum(p[j] * s[k - j] for j in range(first, len(p)) if k - j >= 0)

    x = []
    for k in range(len(r)):
        y.append(-sum(plant.a[j] * y[k - j] for j in range(1, len(plant.a)) if k - j >= 0))
        y[k] += sum(
            plant.b[j] * x[k - j - plant.delay]
            for j in range(len(plant.b))
            if k - j - plant.delay >= 0
        )
        e.append(r[k] - y[k] - noise[k])
        raw = (past(num, e, k, 0) + past(through, r, k, 0) - past(den, u_mem, k, 1)) / den[0]
        u.append(max(-repet.value, min(repet.value, raw)))
        acted[1] += abs(raw) > repet.value
        u_mem.append(u[k] if repet.remember_clipped else raw)
        if inner is None:
            raw = u[k]
        else:
            i.append(u[k] - y[k] - noise[k])
            raw = past(inner.b, i, k, 0) - past(inner.a, v_mem, k, 1)
        v.append(max(-command.value, min(command.value, raw)))
        acted[0] += abs(raw) > command.value
        v_mem.append(v[k] if command.remember_clipped else raw)
        x.append(v[k] + w[k])
    return {"output": y, "command": v, "repetitive": u, "measured_error": e}, acted


def thesis(period, gain, n, runout, literal_25=False):
    """Eqs 24-28 of Horng (1989) with unrounded coefficients, the reference 20.

    `literal_25` keeps the printed shift of eq. 25.
    """
    kp, alpha, a1, a2, b0, b1 = 0.064, 1.5, -0.7537, -0.2404, 9.0452, -7.8975
    ki = kp * (alpha - 1)
    p = [1, a1 - 1 + kp * b0, a2 - a1 + kp * b1 + ki * b0, -a2 + ki * b1]
    q = [kp * b0, kp * b1 + ki * b0, ki * b1]
    force, command, error, inner, v_r = ({} for _ in range(5))

    def get(s, k):
        return s.get(k, 0.0)

    def w(k):
        return runout[k] if 0 <= k < n else 0.0

    for k in range(n):
        late = 1 if literal_25 else 0
        force[k] = -a1 * get(force, k - 1) - a2 * get(force, k - 2)
        force[k] += b0 * (get(command, k - 1 - late) + w(k - 1 - late))
        force[k] += b1 * (get(command, k - 2 - late) + w(k - 2 - late))
        error[k] = 20.0 - force[k]
        u = sum(gain * p[i] * get(error, k - period + 1 - i) for i in range(4))
        for i in range(3):
            u += q[i] * get(v_r, k - period - i) - (q[i] * get(v_r, k - i) if i else 0.0)
        v_r[k] = u / q[0]
        inner[k] = v_r[k] - force[k]
        command[k] = get(command, k - 1) + kp * inner[k] + ki * get(inner, k - 1)
    found = {"output": force, "command": command, "repetitive": v_r, "error": error}
    return {name: np.array(list(s.values())) for name, s in found.items()}


def circulant_solution(loop, r, w):
    """y, v, u, e of the steady state as linear equations in time, the shift being circular."""
    n = r.size
    plant, inner, rc = loop.process.plant, loop.process.controller, loop.repetitive
    shift = np.roll(np.eye(n), 1, axis=0)

    def circ(p):
        return sum(c * np.linalg.matrix_power(shift, i) for i, c in enumerate(p))

    one, none = np.eye(n), np.zeros((n, n))
    a, b = circ(plant.a), circ(np.r_[np.zeros(plant.delay), plant.b])
    k_num, k_den, feedback = (one, one, 0.0) if inner is None else (circ(inner.b), circ(inner.a), 1)
    if rc is None:
        num, den, through = none, one, one
    else:
        den, num = controller_polynomials(rc)
        num, den = rc.gain * circ(num), circ(den)
        through = den if loop.form == "plug-in" else none
    matrix = np.block(
        [
            [a, -b, none, none],
            [feedback * k_num, k_den, -k_num, none],
            [none, none, den, -num],
            [one, none, none, one],
        ]
    )
    right = np.concatenate([b @ w, np.zeros(n), through @ r, r])
    return np.linalg.solve(matrix, right).reshape(4, n)


def recursion(loop, r, w, noise, limits, bound=1e30):
    """The recursions with clipping one sample after the other, until a signal leaves its bound.

    y, v, u up to there, whether it ended early, and how often the limits on v and u acted.
    """
    n, c, feedback = loop.process.parts
    ng, dg, through = loop.parts
    b, a = loop.process.plant.numerator, loop.process.plant.a
    lags = max(p.size for p in (ng, dg, through, a, b, n, c)) - 1
    bound = bound * np.abs([r, w, noise]).max()
    r, w, noise = np.pad([r, w, noise], ((0, 0), (lags, 0)))
    y, e, u, v, inner, sent, kept_u, kept_v, acts_v, acts_u = np.zeros((10, r.size))
    most_u, most_v = limits.repetitive, limits.command
    terms = {name: np.flatnonzero(p) for name, p in (("ng", ng), ("dg", dg), ("through", through))}

    def recall(p, s, k, first=0, at=None):
        at = np.arange(p.size) if at is None else at
        at = at[at >= first]
        return p[at] @ s[k - at]

    for k in range(lags, r.size):
        y[k] = recall(b, sent, k) - recall(a, y, k, 1)
        measured = y[k] + noise[k]
        e[k] = r[k] - measured
        asked = recall(ng, e, k, 0, terms["ng"]) + recall(through, r, k, 0, terms["through"])
        asked = (asked - recall(dg, kept_u, k, 1, terms["dg"])) / dg[0]
        u[k] = np.clip(asked, -most_u.value, most_u.value)
        acts_u[k] = abs(asked) > most_u.value
        kept_u[k] = u[k] if most_u.remember_clipped else asked
        inner[k] = u[k] - feedback * measured
        asked = (recall(n, inner, k) - recall(c, kept_v, k, 1)) / c[0]
        v[k] = np.clip(asked, -most_v.value, most_v.value)
        acts_v[k] = abs(asked) > most_v.value
        kept_v[k] = v[k] if most_v.remember_clipped else asked
        sent[k] = v[k] + w[k]
        if not max(abs(y[k]), abs(u[k]), abs(v[k])) <= bound:
            break
    else:
        k += 1
    counts = int(acts_v[lags:k].sum()), int(acts_u[lags:k].sum())
    return (y[lags:k], v[lags:k], u[lags:k]), k < r.size, counts


def filtered(loop, r, w, noise):
    """y, v, u by filtering through the closed-loop transfers."""

    return [
        sum(
            lfilter(*repetitive.transfer(loop, source, output), s)
            for source, s in zip(("reference", "disturbance", "noise"), (r, w, noise), strict=True)
        )
        for output in SIGNALS
    ]


def stable_factors(d, n, highest):
    """Intervals of k for which d + k n has all roots inside, by roots of polynomials alone."""
    d, n = padded(d, n)
    crossing = np.convolve(d, n[::-1]) - np.convolve(n, d[::-1])
    crossing[np.abs(crossing) < 1e-18 * np.abs(crossing).max()] = 0
    z = np.roots(crossing)
    z = z[np.abs(np.abs(z) - 1) < 1e-4]
    x = np.append(np.abs(z) / z, [1.0, -1.0])
    with np.errstate(divide="ignore", invalid="ignore"):
        gains = -(np.polyval(d[::-1], x) / np.polyval(n[::-1], x)).real
    gains = np.unique(gains[np.isfinite(gains) & (gains > 1e-7) & (gains < highest)])
    edges = np.concatenate([[0.0], gains, [highest]])
    edges = edges[np.append(True, np.diff(edges) > 1e-9)]

    def stable(gain):
        return bool(np.all(np.abs(np.roots(np.trim_zeros(d + gain * n, "b"))) < 1 - 1e-9))

    found = []
    for low, high in pairwise(edges):
        if stable((low + high) / 2):
            if found and found[-1][1] == low and stable(low):
                low = found.pop()[0]
            found.append((low, high))
    return found


def lowest_crossing(d, n, points):
    """The lowest gain at which a root of d + k n reaches the circle, in extended precision.

    A search for real values of -d/n along the circle, by bisection, no derivative used.
    """
    one = np.longdouble(1)

    def at(p, angle):
        lags = np.flatnonzero(p)
        return (
            sum(p[i] * np.cos(i * angle) for i in lags),
            -sum(p[i] * np.sin(i * angle) for i in lags),
        )

    def ratio(angle):
        (dr, di), (nr, ni) = at(d, angle), at(n, angle)
        size = nr * nr + ni * ni
        return -(dr * nr + di * ni) / size, -(di * nr - dr * ni) / size

    pi = 4 * np.arctan(one)
    grid = pi * (np.arange(points) + one / 2) / points
    _, imaginary = ratio(grid)
    i = np.flatnonzero(np.sign(imaginary[1:]) != np.sign(imaginary[:-1]))
    low, high = grid[i], grid[i + 1]
    for _ in range(64):
        middle = (low + high) / 2
        same = np.sign(ratio(middle)[1]) == np.sign(ratio(low)[1])
        low, high = np.where(same, middle, low), np.where(same, high, middle)
    ends = [ratio(np.array([end]))[0] for end in (0 * one, pi)]
    gains = np.concatenate([ratio(low)[0], *ends])
    return float(gains[gains > 1e-6].min())
