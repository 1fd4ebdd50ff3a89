"""One vocabulary: the same verb has the same arguments and the same meaning in every room."""

import inspect
from dataclasses import fields

import control
import numpy as np
import pytest

from rcbook import zdomain
from rcbook.loops import learning, memory, periodic, repetitive
from rcbook.loops.learning import CONTINUOUS, LearningLaw, Scheme
from rcbook.loops.periodic import PeriodicLoop
from rcbook.loops.repetitive import Loop, RepetitiveController
from rcbook.loops.run import Run
from rcbook.loops.verdict import OUTPUTS, SOURCES, Verdict
from rcbook.zdomain import NoncausalFilter

ROOMS = (repetitive, learning, periodic)
TIME = (repetitive, periodic)
VERBS = {
    "factor": ["z"],
    "verdict": [],
    "spectral_radius": [],
    "steady_state": ["reference", "disturbance"],
    "noise_gain": ["output", "source"],
    "mismatch": ["z"],
}
name = {room: room.__name__.split(".")[-1] for room in ROOMS}


def arguments(verb):
    return list(inspect.signature(verb).parameters.values())


@pytest.mark.parametrize("room", ROOMS, ids=name.get)
@pytest.mark.parametrize("verb", VERBS)
def test_every_room_has_the_verb_with_the_same_arguments(room, verb):
    """The loop first, then what the vocabulary names; what a room adds comes after, by keyword."""
    first, *others = arguments(getattr(room, verb))
    assert first.kind == first.POSITIONAL_OR_KEYWORD
    shared, further = others[: len(VERBS[verb])], others[len(VERBS[verb]) :]
    assert [each.name for each in shared] == VERBS[verb]
    assert all(each.kind == each.KEYWORD_ONLY for each in further)


@pytest.mark.parametrize("room", ROOMS, ids=name.get)
def test_every_room_simulates_alike(room):
    _, reference, *others = arguments(room.simulate)
    assert reference.name == "reference"
    assert all(each.kind == each.KEYWORD_ONLY for each in others)
    assert {"disturbance", "noise", "limits"} <= {each.name for each in others}


def test_outputs_and_sources_are_the_same_words_everywhere():
    for room in ROOMS:
        _, output, source, *_ = arguments(room.noise_gain)
        assert (output.default, source.default) == ("output", "noise")
        assert output.default in OUTPUTS
        assert source.default in SOURCES


def test_one_word_for_one_thing():
    """What these words replaced is gone."""
    gone = {
        "regeneration",
        "error_factor",
        "frozen_symbol",
        "decide",
        "learn",
        "stability",
        "PeriodicRun",
    }
    for room in ROOMS:
        left = {word for word in gone if callable(getattr(room, word, None))}
        assert not left, name[room]


@pytest.mark.parametrize("loop", [Loop, PeriodicLoop, Scheme])
def test_a_loop_holds_what_it_runs_on_and_what_it_was_designed_on(loop):
    held = {field.name for field in fields(loop)}
    assert "model" in held
    assert held & {"plant", "process"}
    assert isinstance(vars(loop)["look_ahead"], property)


# ---- the three rooms on one loop ----


SYSTEM = control.tf([400.0], [1.0, 30.0, 400.0])  # an oscillator of 20 rad/s, well damped
DT, N = 0.05, 12
KEPT = 1e-9  # a radius below which no zero is cancelled, as the periodic design does


def loops(gain, q=(1.0,)):
    """The same loop in every room: constant interval, all zeros kept, peak bounded by the sum."""
    intervals = np.full(N, DT)
    plant = zdomain.zero_order_hold(control.ss(SYSTEM), DT)
    inverse = zdomain.zero_phase_inverse(plant, KEPT, "l1")
    time = Loop(plant, RepetitiveController(inverse, memory.plain(N, q), gain))
    law = LearningLaw(NoncausalFilter(gain * inverse.b, inverse.a, inverse.advance), q)
    passes = Scheme(plant, law, N, CONTINUOUS)
    varying = PeriodicLoop(
        periodic.sample(control.ss(SYSTEM), intervals),
        periodic.zero_phase(control.ss(SYSTEM), intervals),
        memory.plain(N, q),
        gain,
    )
    return {repetitive: time, learning: passes, periodic: varying}


LIMIT = repetitive.gain_limit(loops(0.5)[repetitive])
CASES = {"slow": (0.3, (1.0,)), "with q": (0.9, (0.25, 0.5, 0.25))}
each = pytest.mark.parametrize("gain, q", CASES.values(), ids=CASES.keys())
# sums of some hundred products of numbers of order one
CLOSE = {"rtol": 1e-12, "atol": 1e-12}


@each
def test_the_factor_is_the_same(gain, q):
    z = np.exp(1j * np.linspace(0.05, 3.1, 9))
    found = [np.atleast_2d(room.factor(loop, z)) for room, loop in loops(gain, q).items()]
    plant = zdomain.zero_order_hold(control.ss(SYSTEM), DT)
    b = np.abs(zdomain.evaluate(plant.b, z)) ** 2 / np.sum(np.abs(plant.b)) ** 2
    expected = zdomain.zero_phase_gain(q, z) * (1 - gain * b)  # closed form: G C = |B|^2/b
    for one in found:
        np.testing.assert_allclose(one, np.broadcast_to(expected, one.shape), **CLOSE)


@each
def test_the_spectral_radius_is_per_period_in_every_room(gain, q):
    found = [room.spectral_radius(loop) for room, loop in loops(gain, q).items()]
    np.testing.assert_allclose(found, found[0], **CLOSE)


@pytest.mark.parametrize(
    "gain, expected", [(0.3, "stable"), (LIMIT, "undecided"), (2.6, "unstable")]
)
def test_the_verdict_is_the_same_word(gain, expected):
    """At the largest stable gain a root lies on the circle, which nobody may decide."""
    for room, loop in loops(gain).items():
        verdict = room.verdict(loop)
        assert isinstance(verdict, Verdict)
        assert verdict.verdict == expected, name[room]
        assert verdict.method
        assert verdict.certificate


@each
@pytest.mark.parametrize("source", ["disturbance", "noise"])
def test_runs_agree(gain, q, source):
    rng = np.random.default_rng(4)
    # nothing in the first two periods: learning corrects nothing in its pass 0
    signal = np.append(np.zeros(2 * N), rng.standard_normal(6 * N))
    runs = {}
    for room, loop in loops(gain, q).items():
        if room is learning:
            rows = signal.reshape(-1, N)
            runs[room] = room.simulate(loop, np.zeros(N), passes=7, **{source: rows})
        else:
            runs[room] = room.simulate(loop, np.zeros(8 * N), **{source: signal})
            assert isinstance(runs[room], Run)
    for output in ("output", "error", "measured_error", "command"):
        found = [np.ravel(getattr(run, output)) for run in runs.values()]
        for one in found[1:]:
            np.testing.assert_allclose(one, found[0], err_msg=output, **CLOSE)


@each
def test_steady_states_agree(gain, q):
    d = np.random.default_rng(5).standard_normal(N)
    runs = [
        room.steady_state(loop, np.zeros(N), disturbance=d) for room, loop in loops(gain, q).items()
    ]
    for output in ("output", "error", "command"):
        found = [np.ravel(getattr(run, output)) for run in runs]
        for one in found[1:]:
            np.testing.assert_allclose(one, found[0], err_msg=output, **CLOSE)


@each
@pytest.mark.parametrize("output", OUTPUTS)
@pytest.mark.parametrize("source", ["noise", "disturbance"])
def test_noise_gains_agree(gain, q, output, source):
    found = [room.noise_gain(loop, output, source) for room, loop in loops(gain, q).items()]
    # sums of squares over some hundred periods
    np.testing.assert_allclose(found, found[0], rtol=1e-10)


@pytest.mark.parametrize("room", ROOMS, ids=name.get)
@pytest.mark.parametrize("gain", [LIMIT, 2.6])
def test_no_room_gives_a_steady_state_to_a_loop_that_is_not_stable(room, gain):
    loop = loops(gain)[room]
    for ask in (lambda: room.steady_state(loop, np.zeros(N)), lambda: room.noise_gain(loop)):
        with pytest.raises(ValueError, match=r"unstable|undecided"):
            ask()


@pytest.mark.parametrize("room", ROOMS, ids=name.get)
def test_the_look_ahead_is_the_same_number(room):
    loop = loops(0.9, CASES["with q"][1])[room]
    # a delay of one, one zero kept, and one tap of q
    assert loop.look_ahead == 3


@pytest.mark.parametrize("room", ROOMS, ids=name.get)
def test_the_mismatch_is_that_of_the_two_plants(room):
    """A plant three halves as strong as the model differs from it by one half, everywhere."""
    from dataclasses import replace

    loop, z = loops(0.3)[room], np.exp(1j * np.array([0.2, 1.5]))
    held = "process" if room is repetitive else "plant"
    plant = getattr(loop, held)
    if room is repetitive:
        plant = plant.plant
    stronger = replace(plant, b=1.5 * plant.b)
    other = replace(loop, **{held: stronger}, model=plant)
    np.testing.assert_allclose(np.atleast_2d(room.mismatch(other, z)), 0.5, **CLOSE)
