"""The face mill by its equations in the cutter angle, its balances, and its model in decimals."""

import decimal
from bisect import bisect_right
from decimal import Decimal
from itertools import pairwise

import numpy as np
import scipy.integrate

RECORDS = ("time", "speed", "current", "force", "torque")


class Reference:
    """Eqs 1-9 and 12 with fig. 3, by an adaptive method in the cutter angle, pitch by pitch.

    From one entry, exit or sample to the next the teeth in the cut and the command are constant;
    the time one tooth pitch ago comes from the piece that was integrated then.  `held_over` is the
    width, as a part of the limit, over which the velocity integral fades out, so that a sliding
    along the limit stays a differential equation.  Records stand at every quarter of a sample.
    """

    QUARTERS = 4

    def __init__(self, experiment, turns, rtol=1e-9, held_over=1e-3):
        self.one, self.mill, self.drive = experiment, experiment.mill, experiment.mill.drive
        self.held_over, self.rtol, m = held_over, rtol, self.mill
        self.pitch, self.feed = 2 * np.pi / m.teeth, m.feed_per_turn * m.speed / (2 * np.pi)
        self.stiffness = m.cutting_coefficient * m.depth
        self.per_turn = m.teeth * m.samples_per_pitch
        self.starts, self.times = [-np.inf], [lambda angle: angle / m.speed]
        self.records, self.seen, self.sent = {name: [] for name in RECORDS}, [], []
        self.standstill = None
        self.run(turns)

    def at_rest(self):
        """Speed, current, tachometer, current integral, velocity integral and time."""
        d, w = self.drive, self.mill.speed
        i = d.friction * w / d.torque_constant
        amplified = (d.resistance * i + d.back_emf * w) / (d.loop_gain * d.current_integral)
        return np.array([w, i, d.tacho_gain * w, amplified, d.current_feedback * i, 0.0])

    def time_before(self, angle):
        """Time at one tooth pitch before an angle."""
        angle -= self.pitch
        return self.times[bisect_right(self.starts, angle + 1e-12) - 1](angle)

    def teeth_at(self, angle):
        """Teeth in the cut at an angle that is no entry or exit."""
        engaged = 2 * np.pi * (self.one.engaged - 1)
        if angle < engaged:
            return ()
        own = [(angle - tooth * self.pitch) % (2 * np.pi) for tooth in range(self.mill.teeth)]
        entered = [angle - (a - self.mill.entry) for a in own]
        return tuple(
            tooth
            for tooth, a in enumerate(own)
            if self.mill.entry < a < self.mill.exit
            and (self.one.entry == "at once" or entered[tooth] > engaged - 1e-9)
        )

    def chips(self, angle, fed, teeth):
        chips = [fed * np.sin(angle - i * self.pitch) + self.mill.runout[i] for i in teeth]
        return chips if self.one.keep_negative else [max(0.0, chip) for chip in chips]

    def loads(self, angle, state, teeth):
        """Largest force and torque."""
        fed = self.feed * (state[5] - self.time_before(angle))
        force = self.stiffness * max(self.chips(angle, fed, teeth), default=0.0)
        if self.one.torque == "instantaneous":
            fed = self.feed * self.pitch / state[0]
        total = sum(self.chips(angle, fed, teeth))
        return force, self.mill.diameter / 2 * self.stiffness * total

    def rates(self, angle, state, teeth, command):
        d = self.drive
        w, i, wa, current_integral, velocity_integral, _ = state
        torque = self.loads(angle, state, teeth)[1] if teeth else 0.0
        wanted = d.velocity_gain * (command - wa) + velocity_integral
        limit = d.current_feedback * d.current_limit
        missing = min(max(wanted, -limit), limit) - d.current_feedback * i
        voltage = d.loop_gain * (d.current_gain * missing + d.current_integral * current_integral)
        running = 1.0
        if self.one.limit == "hold":
            running = min(max(1 + (1 - abs(wanted) / limit) / self.held_over, 0.0), 1.0)
        by_time = [
            (d.torque_constant * i - d.friction * w - torque) / d.inertia,
            (voltage - d.resistance * i - d.back_emf * w) / d.inductance,
            (d.tacho_gain * w - wa) / d.tacho_lag,
            missing,
            running * d.velocity_integral * (command - wa),
            1.0,
        ]
        return np.array(by_time) / max(w, 1e-4 * self.mill.speed)

    def command_at(self, k):
        """What the controller adds at sample k, by its difference equation."""
        if self.one.controller is None:
            return 0.0
        numerator, denominator = self.one.controller.numerator, self.one.controller.denominator
        begun = (self.one.controlled - 1) * self.per_turn
        target = self.stiffness * self.mill.feed_per_turn / self.mill.teeth
        if self.one.output == "torque":  # eq. 13
            arc = np.cos(self.mill.entry) - np.cos(self.mill.exit)
            target = self.mill.diameter / 2 * self.stiffness * self.feed / self.mill.speed * arc
        total = 0.0
        for lag, c in enumerate(numerator[: k - begun + 1] if k >= begun else ()):
            total += c * (target - self.seen[k - lag])
        for lag, c in enumerate(denominator[1 : k + 1], 1):
            total -= c * self.sent[k - lag]
        return total / denominator[0]

    def record(self, state, loads):
        for name, value in zip(RECORDS, (state[5], *state[:2], *loads), strict=True):
            self.records[name].append(value)

    def pieces(self, first, last):
        """Edges between two angles at which a tooth enters or leaves."""
        edges = [first, last]
        for tooth in range(self.mill.teeth):
            for border in (self.mill.entry, self.mill.exit):
                here = tooth * self.pitch + border
                here += 2 * np.pi * np.ceil((first + 1e-9 - here) / (2 * np.pi))
                if here < last - 1e-9:
                    edges.append(here)
        return sorted(edges)

    def run(self, turns):
        state, loads = self.at_rest(), (0.0, 0.0)
        sizes = np.array([state[0], 10.0, state[2], state[3], 0.05, 0.1])
        base = self.drive.tacho_gain * self.mill.speed
        step = 2 * np.pi / self.per_turn
        self.record(state, loads)

        def slow(angle, state, *_):
            return state[0] - 0.01 * self.mill.speed

        slow.terminal = True
        for k in range(turns * self.per_turn):
            self.seen.append(loads[self.one.output == "torque"])
            self.sent.append(self.command_at(k))
            edges = self.pieces(k * step, (k + 1) * step)
            ticks = step * (k + np.arange(1, self.QUARTERS + 1) / self.QUARTERS)
            for start, end in pairwise(edges):
                teeth = self.teeth_at((start + end) / 2)
                done = scipy.integrate.solve_ivp(
                    self.rates,
                    (start, end),
                    state,
                    method="LSODA",
                    args=(teeth, base + self.sent[k]),
                    rtol=self.rtol,
                    atol=self.rtol * sizes,
                    dense_output=True,
                    events=slow,
                )
                assert done.success
                if done.status == 1:
                    self.standstill = done.t[-1] / (2 * np.pi)
                    return
                self.starts.append(start)
                self.times.append(lambda angle, path=done.sol: path(angle)[5])
                for tick in ticks[(ticks > start + 1e-9) & (ticks <= end + 1e-9)]:
                    now = done.sol(tick) if tick < end - 1e-9 else done.y[:, -1]
                    loads = self.loads(tick, now, teeth)
                    self.record(now, loads)
                state = done.y[:, -1]

    def difference(self, run, name):
        """Largest difference of a record of a run from this one."""
        every = run.experiment.substeps // self.QUARTERS
        return np.abs(getattr(run, name)[::every] - np.array(self.records[name])).max()


def imbalance(run, over):
    """Momentum over time, or energy over angle, that the run's own records do not explain."""
    d = run.experiment.mill.drive
    torque = d.torque_constant * run.current - d.friction * run.speed - run.torque
    along, stored = {
        "time": (run.time, d.inertia * run.speed),
        "angle": (2 * np.pi * run.turns, d.inertia * run.speed**2 / 2),
    }[over]
    done = scipy.integrate.cumulative_trapezoid(torque, along, initial=0)
    return np.abs(stored - stored[0] - done).max() / np.ptp(stored)


def chips_by_hand(run):
    """Chip thickness of every tooth from the run's own clock, NaN for a tooth out of the cut."""
    one, mill = run.experiment, run.experiment.mill
    n, back = one.steps_per_turn, one.mill.samples_per_pitch * one.substeps
    chips = np.full((run.time.size, mill.teeth), np.nan)
    for k in range(1, run.time.size):
        if k <= (one.engaged - 1) * n:
            continue
        before = run.time[k - back] if k >= back else (k - back) * 2 * np.pi / n / mill.speed
        for tooth in range(mill.teeth):
            middle = (2 * np.pi * (k - 0.5) / n - tooth * mill.pitch) % (2 * np.pi)
            entered = (k - 0.5) - (middle - mill.entry) * n / (2 * np.pi)
            late = one.entry == "one by one" and entered < (one.engaged - 1) * n - 1e-6
            if mill.entry < middle < mill.exit and not late:
                own = 2 * np.pi * k / n - tooth * mill.pitch
                fed = mill.feed_per_turn * mill.speed / (2 * np.pi) * (run.time[k] - before)
                chips[k, tooth] = fed * np.sin(own) + mill.runout[tooth]
    return chips


def matrix_product(x, y):
    return [
        [sum(a * b for a, b in zip(row, column, strict=True)) for column in zip(*y, strict=True)]
        for row in x
    ]


def exponential(m, halvings):
    """e^m in decimals: a series for m/2^halvings, squared."""
    size = range(len(m))
    m = [[x / 2**halvings for x in row] for row in m]
    term = total = [[Decimal(i == j) for j in size] for i in size]
    for k in range(1, 60):
        term = [[x / k for x in row] for row in matrix_product(term, m)]
        total = [[total[i][j] + term[i][j] for j in size] for i in size]
    for _ in range(halvings):
        total = matrix_product(total, total)
    return total


def characteristic(m):
    """Coefficients of det(1 - m/z), by Faddeev and LeVerrier."""
    size, found = range(len(m)), [Decimal(1)]
    power = [[Decimal(i == j) for j in size] for i in size]
    for k in range(1, len(m) + 1):
        product = matrix_product(m, power)
        found.append(-sum(product[i][i] for i in size) / k)
        power = [[product[i][j] + found[k] * (i == j) for j in size] for i in size]
    return found


def control_model_in_decimals(depth):
    """Numerator and denominator of the sampled force model at a depth in m, given as text.

    From table 1 in 160 digits, by matrix exponential and characteristic polynomial, without modes.
    """
    with decimal.localcontext(prec=160):
        pi = Decimal("3.14159265358979323846264338327950288419716939937510582097494459")
        w0, k = 200 * 2 * pi / 60, Decimal("7.6332e8") * Decimal(depth)
        v0 = Decimal("0.48e-3") * w0 / (2 * pi)
        slope = -Decimal("0.05") * k * 2 * v0 / w0**2
        inertia, friction, inductance = map(Decimal, ("0.04041", "0.02158", "0.0063"))
        kt, kpv, kiv, kf = map(Decimal, ("0.91", "2.805", "241", "0.05"))
        tacho, lag = Decimal("0.0286"), Decimal("0.0004")
        p, i = Decimal(13) * 240, Decimal(13) * 1200000
        rows = [  # speed, current, tachometer, two integrals, command, integral of the speed
            [-(friction + slope) / inertia, kt / inertia, 0, 0, 0, 0, 0],
            [-kt, -(Decimal("0.45") + p * kf), -p * kpv, i, p, p * kpv, 0],
            [tacho / lag, 0, -1 / lag, 0, 0, 0, 0],
            [0, -kf, -kpv, 0, 1, kpv, 0],
            [0, 0, -kiv, 0, 0, kiv, 0],
            [0, 0, 0, 0, 0, 0, 0],
            [1, 0, 0, 0, 0, 0, 0],
        ]
        rows[1] = [x / inductance for x in rows[1]]
        step = 2 * pi / 40
        whole = exponential([[Decimal(x) * step / w0 for x in row] for row in rows], 40)
        # the last row integrates over time; over the angle it is w0 times as much
        a = characteristic([row[:5] for row in whole[:5]])
        state, impulse = [[row[5]] for row in whole[:5]], [whole[6][5] * w0]
        for _ in range(5):
            impulse.append(matrix_product([whole[6][:5]], state)[0][0] * w0)
            state = matrix_product([row[:5] for row in whole[:5]], state)
        b = [sum(a[m] * impulse[n - m] for m in range(n + 1)) for n in range(6)]
        b = [-k * v0 / w0**2 * x for x in b]
        b = [sum(b[max(0, n - 4) : n + 1]) for n in range(10)]  # five intervals to a pitch
    return [float(x) for x in b], [float(x) for x in a]
