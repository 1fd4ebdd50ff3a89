"""Bad input is a ValueError at the door, with the value and the mend in its message.

Each row: a name, a call, and what the message must hold (value first, then mend), as regular
expressions.  Rows under DEFECTS get through silently, raise something else, or mislead.
"""

from dataclasses import replace

import control
import numpy as np
import pytest

from rcbook import identify, signals, zdomain
from rcbook.loops import repetitive
from rcbook.loops.repetitive import Limit, Loop, Process, RepetitiveController, plain
from rcbook.machines import peripheral_mill
from rcbook.zdomain import NoncausalFilter, Plant

NAN, INF = np.nan, np.inf
LAG = Plant([0.5, 0.2], [1, -0.9, 0.1], 2, 1.0)
PROCESS = Process(LAG)
LOOP = repetitive.design(PROCESS, 6, 0.5)
FAST_LOOP = LOOP.with_gain(2.5)
ON_CIRCLE = LOOP.with_gain(2.0)
UNSTABLE = Plant([1.0], [1, -1.2], 1, 1.0)
INTEGRATOR = Plant([1.0], [1, -1.0], 1, 1.0)
MILL = peripheral_mill.HORNG1989
TWO_BY_TWO = control.ss(-np.eye(2), np.eye(2), np.eye(2), np.zeros((2, 2)))
ZEROS6 = np.zeros(6)


def plant(b=(1.0,), a=(1.0, -0.5), delay=1, dt=1.0):
    return Plant(b, a, delay, dt)


def design(process=PROCESS, memory=6, gain=0.5):
    return repetitive.design(process, memory, gain)


def controller(advance=1, period=6, gain=0.5, q=(1.0,)):
    return RepetitiveController(NoncausalFilter([1.0], [1.0], advance), plain(period, q), gain)


def bad_signals(good):
    """A record of the right length in every wrong way."""
    n = len(good)
    yield "NaN", [*good[:-1], NAN], rf"(?i)nan.* sample {n - 1}\b"
    yield "infinity", [INF, *good[1:]], r"(?i)inf.* sample 0\b"
    yield "2-D", [good, good], rf"shape \(2, {n}\); give one"
    yield "empty", [], r"shape \(0,\); give one"
    yield "number", 3.0, r"shape \(\); give one"


REFUSED = [
    # plants
    ("plant: improper", lambda: plant(a=[0, 1.0]), r"a = \[0\. 1\.\].*improper; drop"),
    ("plant: late numerator", lambda: plant(b=[0, 1.0]), r"b = \[0\. 1\.\].*add one to the delay"),
    ("plant: nothing", lambda: plant(b=[0.0]), r"b = \[0\.\]"),
    ("plant: empty", lambda: plant(b=[]), r"shape \(0,\); give one"),
    ("plant: 2-D", lambda: plant(a=[[1.0, 0.5]]), r"shape \(1, 2\); give one"),
    ("plant: NaN", lambda: plant(b=[NAN]), r"b = \[nan\].*give finite"),
    ("plant: infinity", lambda: plant(a=[1, INF]), r"\[ *1\. +inf\].*give finite"),
    ("plant: half a delay", lambda: plant(delay=1.5), r"delay = 1\.5 must be a whole number"),
    ("plant: advance", lambda: plant(delay=-1), "delay = -1 must be a whole number not below 0"),
    ("plant: NaN delay", lambda: plant(delay=NAN), "delay = nan must be a whole number"),
    ("plant: dt 0", lambda: plant(dt=0.0), r"dt = 0\.0 must be a positive"),
    ("plant: dt negative", lambda: plant(dt=-1), "dt = -1 must be a positive"),
    ("plant: dt NaN", lambda: plant(dt=NAN), "dt = nan must be a positive"),
    ("plant: dt infinite", lambda: plant(dt=INF), "dt = inf must be a positive"),
    (
        "filter: advance",
        lambda: NoncausalFilter([1], [1], -2),
        "advance = -2 must be a whole number",
    ),
    ("filter: NaN", lambda: NoncausalFilter([1], [NAN], 0), r"a = \[nan\].*give finite"),
    # zero-order hold
    ("hold: dt 0", lambda: zdomain.zero_order_hold(control.tf(1, [1, 1]), 0), "dt = 0 must be"),
    ("hold: dt NaN", lambda: zdomain.zero_order_hold(control.tf(1, [1, 1]), NAN), "dt = nan must"),
    (
        "hold: improper",
        lambda: zdomain.zero_order_hold(control.tf([1, 0, 0], [1, 1]), 0.1),
        "degree 2 exceeds 1: improper",
    ),
    ("hold: MIMO", lambda: zdomain.zero_order_hold(TWO_BY_TWO, 0.1), "2 inputs, 2 outputs; pick"),
    (
        "hold: sampled already",
        lambda: zdomain.zero_order_hold(control.tf(1, [1, 0.5], 0.2), 0.1),
        r"sampled.*0\.2.*continuous",
    ),
    # zeros and inverses
    ("split: radius 0", lambda: zdomain.split_zeros([1, 0.5], 0), "radius = 0 must be a positive"),
    ("split: radius NaN", lambda: zdomain.split_zeros([1, 0.5], NAN), "radius = nan must be"),
    (
        "split: cancels a zero outside",
        lambda: zdomain.split_zeros([1, -1.5], 2.0),
        r"radius = 2\.0 would cancel the zeros \[1\.5\].*choose a radius of 1 or less",
    ),
    (
        "split: cancels a zero on the circle",
        lambda: zdomain.split_zeros([1, 1], 1.1),
        r"radius = 1\.1 would cancel the zeros \[-1\.\].*radius of 1 or less",
    ),
    (
        "inverse: unstable",
        lambda: zdomain.zero_phase_inverse(UNSTABLE),
        r"1\.2.*stabilise the plant",
    ),
    ("inverse: integrator", lambda: zdomain.zero_phase_inverse(INTEGRATOR), r" 1,.*stabilise"),
    (
        "inverse: no such normalisation",
        lambda: zdomain.zero_phase_inverse(LAG, 1.0, "rms"),
        "'rms' is none of peak, dc, l1",
    ),
    (
        "inverse: dc of a differentiator",
        lambda: zdomain.zero_phase_inverse(plant(b=[1, -1]), 1.0, "dc"),
        "vanishes at z = 1.*use 'peak'",
    ),
    ("design: unstable", lambda: design(Process(UNSTABLE)), r"1\.2.*stabilise the plant"),
    # Q filters
    ("Q: even", lambda: zdomain.odd_symmetric([0.5, 0.5]), r"\[0\.5 0\.5\] must be symmetric.*see"),
    ("Q: lopsided", lambda: zdomain.odd_symmetric([0.3, 0.5, 0.2]), "must be symmetric.*see"),
    ("Q: NaN", lambda: zdomain.odd_symmetric([NAN]), r"\[nan\].*give finite"),
    ("Q: 2-D", lambda: zdomain.zero_phase_gain([[1.0]], 1.0), r"shape \(1, 1\); give"),
    ("Q: half a pass", lambda: zdomain.binomial_q(0.5), r"passes = 0\.5 must be a whole"),
    ("Q: in a loop", lambda: plain(6, [0.5, 0.5]), "must be symmetric.*see"),
    # repetitive controllers
    ("period: zero", lambda: design(memory=0), r"period = 0\.0 must be a positive"),
    ("period: negative", lambda: design(memory=-6), r"period = -6\.0 must be"),
    ("period: NaN", lambda: design(memory=NAN), "period = nan must be"),
    ("period: infinite", lambda: design(memory=INF), "period = inf must be"),
    ("gain: zero", lambda: design(gain=0.0), r"gain = 0\.0 must be a positive finite"),
    ("gain: negative", lambda: design(gain=-0.5), r"gain = -0\.5 must be a positive"),
    ("gain: NaN", lambda: design(gain=NAN), "gain = nan must be"),
    ("gain: infinite", lambda: design(gain=INF), "gain = inf must be"),
    ("look-ahead", lambda: controller(advance=7), "look 7 samples ahead.*period of 6.*lengthen"),
    (
        "look-ahead of Q",
        lambda: controller(advance=5, q=zdomain.binomial_q(2)),
        "look 7 samples ahead.*period of 6.*lengthen the period or shorten q",
    ),
    (
        "Q as long as the period",
        lambda: controller(advance=0, period=2, q=zdomain.binomial_q(2)),
        "looks 2 samples ahead.*period of 2",
    ),
    ("look-ahead of a plant", lambda: design(memory=1), "2 samples ahead.*period of 1"),
    ("form", lambda: Loop(PROCESS, None, "parallel"), "'parallel' is none of cascade, plug-in"),
    # processes
    ("process: no delay", lambda: Process(plant(delay=0)), "delay = 0.*give it one step"),
    (
        "process: late controller",
        lambda: Process(LAG, plant(delay=1)),
        "controller delay 1: put it into its b",
    ),
    (
        "process: two rates",
        lambda: Process(LAG, plant(delay=0, dt=0.5)),
        r"controller at 0\.5 s, plant at 1\.0 s; sample both",
    ),
    # loops that are not stable
    (
        "require_stable: unstable",
        lambda: repetitive.require_stable(FAST_LOOP),
        r"is unstable \(.* 6 of \d+ roots outside.*gain is 2\.5, `stable_gains` lists",
    ),
    (
        "require_stable: on the circle",
        lambda: repetitive.require_stable(ON_CIRCLE),
        r"is undecided \(.* 6 within 1e-09 of it.*gain is 2\.0, `stable_gains` lists",
    ),
    (
        "require_stable: process alone",
        lambda: repetitive.require_stable(Process(UNSTABLE)),
        r"unstable \(.* 1 of 1 roots outside.*stabilise the process",
    ),
    (
        "steady_state: unstable",
        lambda: repetitive.steady_state(FAST_LOOP, ZEROS6),
        r"unstable.*gain is 2\.5",
    ),
    (
        "steady_state: on the circle",
        lambda: repetitive.steady_state(ON_CIRCLE, ZEROS6),
        r"undecided.*gain is 2\.0",
    ),
    (
        "steady_state: wrong length",
        lambda: repetitive.steady_state(LOOP, np.zeros(7)),
        "7 samples, no whole periods of 6; cut or repeat",
    ),
    (
        "steady_state: disturbance of another length",
        lambda: repetitive.steady_state(LAG, np.zeros(7), disturbance=np.zeros(6)),
        "has 6 samples.* 7 are needed; make them agree",
    ),
    ("noise_gain: unstable", lambda: repetitive.noise_gain(FAST_LOOP), "unstable.*stable_gains"),
    ("noise_gain: on the circle", lambda: repetitive.noise_gain(ON_CIRCLE), "undecided.*gains"),
    (
        "transfer: source",
        lambda: repetitive.transfer(LOOP, "force", "output"),
        "'force'.*reference",
    ),
    ("transfer: output", lambda: repetitive.transfer(LOOP, "noise", "force"), "'force'.*command"),
    ("noise_gain: output", lambda: repetitive.noise_gain(LOOP, "force"), "'force'.*command"),
    (
        "noise_gain: source",
        lambda: repetitive.noise_gain(LOOP, "output", "force"),
        "'force'.*disturbance",
    ),
    ("limit: zero", lambda: Limit(0.0), r"limit 0\.0 must be positive"),
    ("limit: negative", lambda: Limit(-50), "limit -50 must be positive"),
    ("limit: NaN", lambda: Limit(NAN), "limit nan must be positive"),
    # measures
    ("overshoot: no target", lambda: signals.overshoot([1.0], 0.0), "other than 0"),
    ("settling: no band", lambda: signals.settling_time([1.0], 1.0, 0.0, 1.0), r"band = 0\.0 must"),
    ("settling: NaN band", lambda: signals.settling_time([1.0], 1.0, NAN, 1.0), "band = nan must"),
    ("harmonic: part of a period", lambda: signals.harmonic(np.ones(7), 3), "7 .* 3; cut the"),
    # identification
    (
        "arx: lengths",
        lambda: identify.arx(np.ones(9), np.ones(8), 1, 1),
        "input u has 9 samples.* 8 are needed; make",
    ),
    (
        "arx: short record",
        lambda: identify.arx(np.ones(6), np.ones(6), 2, 2),
        "6 samples cannot fit 4 parameters; take a longer",
    ),
    (
        "arx: constant input",
        lambda: identify.arx(np.ones(60), np.ones(60), 2, 2),
        "excites 1 of 4 parameters; use a richer",
    ),
    ("arx: no numerator", lambda: identify.arx(ZEROS6, ZEROS6, 1, 0), "nb = 0 must be a whole"),
    ("arx: half a pole", lambda: identify.arx(ZEROS6, ZEROS6, 0.5, 1), r"na = 0\.5 must be a"),
    ("arx: advance", lambda: identify.arx(ZEROS6, ZEROS6, 1, 1, -1), "delay = -1 must be a whole"),
    ("prbs: one bit", lambda: identify.prbs(1), "bits = 1 is outside .*2 to 32"),
    ("prbs: too long", lambda: identify.prbs(33), "bits = 33 is outside .*2 to 32"),
    # the mill
    (
        "resample: mode",
        lambda: peripheral_mill.resample(MILL.plant, 0.01, "round"),
        "'round' is none of keep sign",
    ),
    (
        "resample: delay",
        lambda: peripheral_mill.resample(plant(delay=2), 0.5),
        "delay 2: only a plant of one delay",
    ),
    (
        "resample: repeated poles",
        lambda: peripheral_mill.resample(plant(a=[1, -1, 0.25]), 0.5),
        r"poles \[0\.5 0\.5\]: only distinct",
    ),
    (
        "resample: complex poles",
        lambda: peripheral_mill.resample(plant(a=[1, 0, 0.25]), 0.5),
        "poles .*j.*: only distinct real",
    ),
    ("resample: dt", lambda: peripheral_mill.resample(MILL.plant, -0.01), r"dt = -0\.01 must be"),
]
for take, name in (
    (lambda s: repetitive.simulate(LOOP, s), "simulate: reference"),
    (lambda s: repetitive.simulate(LOOP, ZEROS6, disturbance=s), "simulate: disturbance"),
    (lambda s: repetitive.simulate(LOOP, ZEROS6, noise=s), "simulate: noise"),
    (lambda s: repetitive.respond(LOOP, s), "respond: reference"),
    (lambda s: repetitive.respond(LOOP, ZEROS6, disturbance=s), "respond: disturbance"),
    (lambda s: repetitive.respond(LOOP, ZEROS6, noise=s), "respond: noise"),
    (lambda s: repetitive.steady_state(LOOP, s), "steady_state: reference"),
    (lambda s: repetitive.steady_state(LOOP, ZEROS6, disturbance=s), "steady_state: disturbance"),
    (lambda s: identify.arx(ZEROS6, s, 1, 1), "arx: output"),
    (lambda s: identify.arx(s, ZEROS6, 1, 1), "arx: input"),
    (lambda s: signals.spread(s), "spread"),
    (lambda s: signals.rms(s), "rms"),
    (lambda s: signals.overshoot(s, 1.0), "overshoot"),
    (lambda s: signals.settling_time(s, 1.0, 0.1, 1.0), "settling_time"),
    (lambda s: signals.harmonic(s, 6), "harmonic"),
    (lambda s: signals.periodic(s, 12), "periodic"),
):
    REFUSED += [
        (f"{name}: {kind}", lambda take=take, value=value: take(value), message)
        for kind, value, message in bad_signals(list(ZEROS6))
    ]
for take, name in (
    (lambda s: repetitive.simulate(LOOP, ZEROS6, disturbance=s), "simulate: disturbance"),
    (lambda s: repetitive.simulate(LOOP, ZEROS6, noise=s), "simulate: noise"),
    (lambda s: repetitive.respond(LOOP, ZEROS6, disturbance=s), "respond: disturbance"),
):
    REFUSED.append(
        (f"{name}: length", lambda take=take: take(np.zeros(5)), "5 samples.* 6 are needed; make")
    )


REFUSED += [
    (
        "process: rates apart by 0.9 percent at 1 microsecond (np.isclose has atol=1e-8)",
        lambda: Process(plant(dt=1e-6), plant(delay=0, dt=1.009e-6)),
        "sample both",
    ),
    ("split: leading zero", lambda: zdomain.split_zeros([0, 1, -0.5]), "begins with 0"),
    ("step: NaN", lambda: signals.step(NAN, 5), "nan"),
    ("step: fraction", lambda: signals.step(1.0, 5.5), r"5\.5 must be a whole"),
    ("step: negative", lambda: signals.step(1.0, -5), "-5 must be a whole"),
    ("sinusoid: NaN", lambda: signals.sinusoid(NAN, 10.0, 0.01, 5), "nan"),
    ("sinusoid: fraction", lambda: signals.sinusoid(1.0, 10.0, 0.01, 5.5), r"5\.5 must"),
    ("periodic: fraction", lambda: signals.periodic([1.0, 2.0], 5.5), r"5\.5 must be a whole"),
    (
        "random_period: one sample",
        lambda: signals.random_period(1, 0.3, np.random.default_rng(0)),
        "1 must be a whole number not below 2",
    ),
    ("overshoot: NaN target", lambda: signals.overshoot([1.0, 2.0], NAN), "nan"),
    ("settling: NaN target", lambda: signals.settling_time([9.0], NAN, 0.1, 1.0), "nan|NaN"),
    ("settling: NaN dt", lambda: signals.settling_time([0.0, 1], 1.0, 0.1, NAN), "dt = nan"),
    (
        "settling: column of targets",
        lambda: signals.settling_time([1.0, 2.0, 3.0], np.ones((3, 1)), 0.1, 1.0),
        r"shape \(3, 1\)",
    ),
    (
        "settling: target of another length",
        lambda: signals.settling_time([1.0, 2.0, 3.0], np.ones(2), 0.1, 1.0),
        "2 samples.* 3 are needed",
    ),
    ("harmonic: period 0", lambda: signals.harmonic([1.0, 2.0], 0), "period = 0 must be"),
    ("harmonic: part of 1.5", lambda: signals.harmonic([1.0, 2, 3, 4], 1.5), r"4 .* 1\.5; cut the"),
    (
        "phase_between: nothing to compare with",
        lambda: signals.phase_between([1.0, 2.0, 3.0] * 2, np.ones(6), 3),
        "no fundamental|no harmonic|constant",
    ),
    ("signal: complex", lambda: signals.signal(np.array([1 + 1j])), "real"),
    ("polynomial: complex", lambda: zdomain.polynomial([1 + 1j]), "real"),
    ("plant: dt text", lambda: plant(dt="1"), "dt = '1'"),
    ("gain: text", lambda: design(gain="0.5"), r"'0\.5'"),
    ("plant: overflow", lambda: plant(a=[1e-320, 1.0]), "a = "),
    ("hold: zero plant", lambda: zdomain.zero_order_hold(control.tf(0, [1, 1]), 0.1), "zero"),
    ("stable_gains: no repetitive", lambda: repetitive.stable_gains(Loop(PROCESS)), "repetitive"),
    ("with_gain: no repetitive", lambda: Loop(PROCESS).with_gain(1.0), "repetitive"),
    ("factor: no repetitive", lambda: repetitive.factor(Loop(PROCESS), 1.0), "repetitive"),
    (
        "controller_gains: no controller",
        lambda: repetitive.controller_gains(PROCESS),
        "no controller.*give it one",
    ),
    (
        "stable_gains: highest",
        lambda: repetitive.stable_gains(LOOP, highest=-1.0),
        r"highest = -1\.0 must be a positive",
    ),
    ("frequency: NaN", lambda: repetitive.frequency_response(LOOP, "noise", "output", NAN), "nan"),
    ("prbs: NaN amplitude", lambda: identify.prbs(4, NAN), "nan"),
    ("prbs: no bits", lambda: identify.prbs(0), "2 to 32"),
    ("pi: no gain", lambda: repetitive.pi_controller(0.0, 1.5, 0.1), "gain"),
    ("pi: NaN in alpha", lambda: repetitive.pi_controller(0.1, NAN, 0.1), "alpha"),
    ("resample: integrator", lambda: peripheral_mill.resample(INTEGRATOR, 0.5), r"poles \[1\.\]"),
    ("resample: NaN dt", lambda: peripheral_mill.resample(MILL.plant, NAN), "dt = nan must be"),
    (
        "resample: numerator too long",
        lambda: peripheral_mill.resample(plant(b=[1.0, 0.5, 0.2]), 0.5),
        "numerator",
    ),
    (
        "mill: part of a sample per turn",
        lambda: replace(MILL, spindle_frequency=7.0).samples_per_turn,
        r"8\.57",
    ),
    ("process: which delay", lambda: Process(plant(delay=0)), "delay 0|delay = 0"),
]


def ids(rows):
    return [row[0] for row in rows]


@pytest.mark.parametrize(("name", "call", "message"), REFUSED, ids=ids(REFUSED))
def test_bad_input_is_refused_with_the_value_and_the_mend(name, call, message):
    with pytest.raises(ValueError, match=message):
        call()


def test_arrays_of_a_plant_cannot_be_changed_afterwards():
    b = np.array([1.0, 0.5])
    made = Plant(b, [1.0, -0.5], 1, 1.0)
    b[0] = 7.0
    assert made.b[0] == 1.0
    with pytest.raises(ValueError, match="read-only"):
        made.a[1] = 0.0


def test_a_run_does_not_change_when_the_caller_reuses_the_record():
    reference = np.ones(6)
    run = repetitive.simulate(LOOP, reference)
    reference[:] = 99.0
    assert run.reference[0] == 1.0


@pytest.mark.parametrize("period", [6, 6.0, np.int64(6), np.float64(6.0)])
def test_whole_numbers_are_accepted_in_every_dress(period):
    assert design(memory=period).period == 6


@pytest.mark.parametrize("memory", ["6", True, None])
def test_what_is_no_memory_is_a_type_error_with_the_mend(memory):
    with pytest.raises(TypeError, match=r"give a Memory or a period in samples"):
        design(memory=memory)


@pytest.mark.parametrize("model", ["plant", 3.0, MILL])
def test_what_is_no_process_is_a_type_error_with_the_mend(model):
    for call in (lambda: Loop(model), lambda: Loop(PROCESS, model=model), lambda: design(model)):
        with pytest.raises(TypeError, match=r"no plant, process or loop; make one with `Plant`"):
            call()
