"""Learning once more: sample by sample as it is defined, and as matrices over one pass.

Nothing here is taken from the library but the numbers that plants and laws hold.
"""

import numpy as np
import scipy.linalg


def recursion(b, a, x, k, y):
    """One sample of b/a at k; x(k) and y(k) are functions of time."""
    past = sum(a[i] * y(k - i) for i in range(1, len(a)))
    return (sum(b[i] * x(k - i) for i in range(len(b))) - past) / a[0]


def lookup(known, before):
    return lambda k: known.get(k, before) if k < 0 else known[k]


def plant_output(plant, u, n, rest):
    """Output at 0 .. n-1; command and output were `rest` before."""
    y = {}
    for k in range(n):
        y[k] = recursion(plant.numerator, plant.a, lookup(u, rest), k, lookup(y, rest))
    return y


def law_output(law, error, first, last):
    """H e at samples up to `last`, from rest at `first`; error is a function of time."""
    d, ahead = {}, law.filter.advance
    for k in range(first, last):
        x = lambda j: error(j + ahead)  # noqa: E731
        d[k] = recursion(law.filter.b, law.filter.a, x, k, lambda j: d.get(j, 0.0))
    return d


def by_definition_apart(plant, law, r, first, noise, start, rest, w, most, remember):
    n, half, rows = len(r), law.q.size // 2, []
    u = dict(enumerate(first))
    for row, w_row in zip(noise, w, strict=True):
        sent = {k: min(max(u[k], -most), most) for k in range(n)}
        into = {k: sent[k] + w_row[k] for k in range(n)}
        u = sent if remember else u
        if start.before == "itself":  # 40 repetitions: poles up to 0.9 have died out, 0.9^400
            y = plant_output(plant, {k: into[k % n] for k in range(40 * n)}, 40 * n, 0.0)
            y = {k: y[39 * n + k] for k in range(n)}
        else:
            y = plant_output(plant, into, n, rest)
        e = {k: r[k] - y[k] - row[k] for k in range(n)}
        rows.append(([sent[k] for k in range(n)], [y[k] for k in range(n)]))
        if start.before == "itself":
            d = law_output(law, lambda k, e=e: e[k % n], -40 * n, n)
            moved = lambda k, u=u, d=d: u[k % n] + d[k % n]  # noqa: E731
        else:
            if start.after == "on":
                longer = {k: into[k % n] for k in range(n + law.look_ahead)}
                y = plant_output(plant, longer, n + law.look_ahead, rest)
                e |= {k: r[k % n] - y[k] for k in range(n, n + law.look_ahead)}
            elif start.after == "itself":
                e |= {k: e[k - n] for k in range(n, n + law.look_ahead)}
            begin = 0 if start.forgets else -law.filter.advance
            d = law_output(law, lambda k, e=e: e.get(k, 0.0), begin, n + half)

            def moved(k, u=u, d=d):
                if k < 0:
                    return u[0]
                if k >= n:
                    return (u[n - 1] if start.after == "nothing" else u[k - n]) + d[k]
                return u[k] + d[k]

        u = {k: sum(law.q[i] * moved(k + half - i) for i in range(law.q.size)) for k in range(n)}
    return tuple(np.array(s) for s in zip(*rows, strict=True))


def by_definition_running(plant, law, r, first, noise, start, rest, w, most, remember):
    n, half, ahead = len(r), law.q.size // 2, law.filter.advance
    u, sent, into, y, e, d = {}, {}, {}, {}, {}, {}
    begin, kept = (0 if start.forgets else -ahead), (sent if remember else u)
    for t, disturbed in enumerate(np.ravel(noise)):
        for j in range(begin if t == 0 else t - n + half, t - n + half + 1):
            if j < begin:
                continue
            x = lambda k: e.get(k + ahead, 0.0)  # noqa: E731
            d[j] = recursion(law.filter.b, law.filter.a, x, j, lambda k: d.get(k, 0.0))
        window = [t - n + half - i for i in range(law.q.size)]
        moved = lambda k: kept[k] + d[k] if k >= 0 else first[k % n]  # noqa: E731
        u[t] = first[t] if t < n else sum(law.q[i] * moved(k) for i, k in enumerate(window))
        sent[t] = min(max(u[t], -most), most)
        into[t] = sent[t] + np.ravel(w)[t]
        y[t] = recursion(plant.numerator, plant.a, lookup(into, rest), t, lookup(y, rest))
        e[t] = r[t % n] - y[t] - disturbed
    return tuple(np.array([s[t] for t in range(len(u))]).reshape(-1, n) for s in (sent, y))


def by_definition(plant, law, r, first, noise, start, rest, w=None, most=np.inf, remember=True):
    """Commands, as the plant gets them, and outputs, a row for each row of noise."""
    run = by_definition_running if start.before == "previous" else by_definition_apart
    w = np.zeros(np.shape(noise)) if w is None else w
    return run(plant, law, r, first, noise, start, rest, w, most, remember)


def papers_loop(n, per_turn, forgets, passes):
    """Eqs 16 to 18 as one plain loop over time: largest error in each pass."""
    corner, total = 10 * np.sqrt(2), n * (passes + 1)
    wanted = lambda k: 10 / np.cos((k / per_turn * 4 % 1 - 0.5) * np.pi / 2)  # noqa: E731
    taps = [2.43, 0.6112, -0.1527 - 1e-5, 0.0183 + 9e-6, 0.0063]  # eq. 17, unrounded
    y, u, e, d = {}, {}, {}, {}
    for k in range(total):
        u1, u2, u3 = (u.get(k - i, corner) for i in (1, 2, 3))
        y1, y2, y3 = (y.get(k - i, corner) for i in (1, 2, 3))
        y[k] = 0.14 * (u1 + 3.2 * u2 + 1.8711 * u3) + 0.16 * y1 - 0.003 * y2 - 0.0063 * y3
        e[k] = wanted(k % n) - y[k]
        m = k - 2  # eq. 17 looks two samples ahead
        if m >= (0 if forgets else -2):
            seen = sum(t * e.get(m + 2 - i, 0.0) for i, t in enumerate(taps))
            d[m] = seen / (0.14 * 3.43**2) - 0.77 * d.get(m - 1, 0.0)
        u[k] = wanted(k) if k < n else u[k - n] + d[k - n]
    return [max(abs(e[k]) for k in range(n * i, n * i + n)) for i in range(passes + 1)]


def free_response(plant, rest, n):
    """Output without command after command and output were `rest`."""
    y = {}
    u = {k: rest for k in range(-9, 0)} | {k: 0.0 for k in range(n)}
    for k in range(n):
        y[k] = recursion(plant.numerator, plant.a, u.__getitem__, k, lookup(y, rest))
    return np.array([y[k] for k in range(n)])


def spectral_error(plant, law, r, passes):
    """(1 - G H)^L (1 - G) r, bin by bin."""
    z = np.exp(2j * np.pi * np.fft.fftfreq(r.size))
    g = np.polyval(plant.numerator[::-1], 1 / z) / np.polyval(plant.a[::-1], 1 / z)
    h = z**law.filter.advance * np.polyval(law.filter.b[::-1], 1 / z)
    h /= np.polyval(law.filter.a[::-1], 1 / z)
    return np.fft.ifft((1 - g * h) ** passes * (1 - g) * np.fft.fft(r)).real


def impulse(b, a, n):
    """Power series of b/a, by long division."""
    rest, out = np.concatenate([b, np.zeros(n)])[: n + len(a)], []
    rest = np.pad(rest, (0, len(a)))
    for k in range(n):
        out.append(rest[k] / a[0])
        rest[k : k + len(a)] -= out[-1] * np.asarray(a)
    return np.array(out)


def law_matrix(law, n):
    """H from n + advance samples of error to n of correction, nothing before the first one."""
    long = n + law.filter.advance
    h = impulse(law.filter.b, law.filter.a, long)
    ahead = law.filter.advance
    return np.array(
        [[h[k + ahead - j] if k + ahead >= j else 0 for j in range(long)] for k in range(n)]
    )


def lifted(plant, law, n, after):
    """Matrices over a pass from rest, for a law with q = 1: what the law makes of its errors, the
    errors of a command, and the errors of references and of noise."""
    ahead = law.filter.advance
    long = n + ahead
    toeplitz = scipy.linalg.toeplitz(impulse(plant.numerator, plant.a, long), np.zeros(long))
    wrap, cut = np.eye(n)[np.arange(long) % n], np.eye(long, n)
    spread = wrap if after == "itself" else cut
    sense = toeplitz @ wrap if after == "on" else spread @ toeplitz[:n, :n]
    wanted = wrap if after == "on" else spread
    return law_matrix(law, n), sense, wanted, spread, toeplitz[:n, :n]


def lifted_pass(plant, law, r, after, rest):
    """M and v of u_(L+1) = M u_L + v, and T, t of y = T u + t, for a law with q = 1."""
    n = r.size
    h, sense, wanted, spread, toeplitz = lifted(plant, law, n, after)
    free = free_response(plant, rest, n + law.filter.advance)
    left = free if after == "on" else spread @ free[:n]
    return np.eye(n) - h @ sense, h @ (wanted @ r - left), toeplitz, free[:n]


def lifted_sources(plant, law, n, after):
    """M, and the matrix from each source to the next command."""
    h, sense, wanted, spread, _ = lifted(plant, law, n, after)
    into = {"reference": h @ wanted, "disturbance": -h @ sense, "noise": -h @ spread}
    return np.eye(n) - h @ sense, into


def companion_radius(plant, law, n):
    """Largest eigenvalue of the map from one sample to the next, by probing every state."""
    memory = n + law.look_ahead + max(plant.numerator.size, law.filter.b.size, law.filter.a.size)
    half, ahead = law.q.size // 2, law.filter.advance

    def step(state):
        u, y, d = state.reshape(3, memory)  # u(t-1-i), y(t-1-i), d(t-n+half-1-i)
        past = lambda s, k: s[-1 - k]  # noqa: E731  k = -1 is the newest
        at = half - n  # d is wanted at time t + at
        x = lambda k: -past(y, k + ahead)  # noqa: E731
        new = recursion(law.filter.b, law.filter.a, x, at, lambda k: past(d, k - at))
        d = np.append(new, d[:-1])
        new = sum(
            law.q[i] * (past(u, at - i) + (d[i] if i < d.size else 0)) for i in range(law.q.size)
        )
        u = np.append(new, u[:-1])
        new = recursion(plant.numerator, plant.a, lambda k: u[-k], 0, lambda k: past(y, k))
        return np.concatenate([u, np.append(new, y[:-1]), d])

    matrix = np.array([step(row) for row in np.eye(3 * memory)]).T
    return np.abs(np.linalg.eigvals(matrix)).max()


def folded(b, a, period):
    """Impulse response of passes that have repeated until 0.9^540 is left."""
    turns = 60 + 480 // period
    return impulse(b, a, turns * period).reshape(turns, period).sum(axis=0)


def circulant(plant, period):
    """Plant as a matrix on periodic signals, from its impulse response folded."""
    return scipy.linalg.circulant(folded(plant.numerator, plant.a, period))


def circulant_law(law, period):
    column = np.roll(folded(law.filter.b, law.filter.a, period), -law.filter.advance)
    q = np.zeros(period)
    for i, tap in enumerate(law.q):
        q[(i - law.q.size // 2) % period] += tap
    return scipy.linalg.circulant(column), scipy.linalg.circulant(q)


def circulant_sources(plant, law, period):
    """M, the matrix from each source to the next command, and the plant, on passes repeated."""
    g, (h, smooth) = circulant(plant, period), circulant_law(law, period)
    once = smooth @ h
    into = {"reference": once, "disturbance": -once @ g, "noise": -once}
    return smooth @ (np.eye(period) - h @ g), into, g


def spread_of(m, b, passes):
    """Covariance of the command after passes of u' = m u + b s, or in the end."""
    if passes is None:  # all of it as one system of linear equations
        size = m.shape[0]
        left = np.eye(size**2) - np.kron(m, m)
        return np.linalg.solve(left, np.ravel(b @ b.T)).reshape(size, size)
    covariance = np.zeros_like(m)
    for _ in range(passes):
        covariance = m @ covariance @ m.T + b @ b.T
    return covariance


def deviation(covariance, g, output, source):
    """Root mean square of an output over a pass whose command has this covariance."""
    n = g.shape[0]
    if output in ("command", "repetitive"):
        return np.sqrt(np.trace(covariance) / n)
    own = g if source == "disturbance" else np.zeros((n, n))
    if output != "output":
        own = own - np.eye(n) * (source == "reference")
        own = own + np.eye(n) * (source == "noise" and output == "measured_error")
    return np.sqrt(np.trace(g @ covariance @ g.T + own @ own.T) / n)


def probed(plant, law, n, start, source, passes):
    """Matrices from every sample of a source to command and output of the last pass of a run."""
    total, still = n * (passes + 1), np.zeros(n)
    columns = []
    for unit in np.eye(total).reshape(total, passes + 1, n):
        nothing = np.zeros_like(unit)
        noise = {"reference": -unit, "noise": unit, "disturbance": nothing}[source]
        w = unit if source == "disturbance" else nothing
        columns.append(
            by_definition_running(plant, law, still, still, noise, start, 0.0, w, np.inf, True)
        )
    u, y = zip(*columns, strict=True)
    return tuple(np.array([x[-1] for x in each]).T for each in (u, y))
