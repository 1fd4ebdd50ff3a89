"""Charts against the growth at every point, exact lobes, and a count of unstable multipliers."""

from dataclasses import replace

import numpy as np
import pytest
from oracles.chatter import unstable_multipliers

from rcbook.machines import chatter
from rcbook.machines.chatter import RPM, Cut, Mode

MODE = chatter.HANSON_TSAO2000.mode
LEAST = chatter.least_limit(MODE)
RINGING = Mode(MODE.mass, MODE.damping / 8, MODE.stiffness)  # 0.6 percent of critical damping


def test_at_constant_speed_the_chart_is_the_lobes():
    """A millionth below and above the exact limit: finer steps are taken until it is decided."""
    speeds = np.linspace(3000, 40_000, 7) * RPM
    limits, _ = chatter.lobes(MODE, speeds)
    axis = np.concatenate([limits * (1 - 1e-6), limits * (1 + 1e-6)])
    chart = chatter.stability_chart(Cut(MODE, 1.0, speeds), axis)
    assert np.array_equal(chart, axis < limits[:, None])


@pytest.mark.parametrize("law", ["time", "angle"])
@pytest.mark.parametrize(
    "mode, speeds, rva, rvf",
    [
        (MODE, (3000, 12_000), 0.2, 0.2),
        (MODE, (6000, 60_000), 0.3, 2.0),
        (RINGING, (3000, 12_000), 0.1, 0.5),
        (RINGING, (8000, 60_000), 0.2, 0.3),
    ],
)
def test_a_chart_is_right_at_every_point(mode, speeds, rva, rvf, law):
    """The growth at all of them, with steps that err by 2/32^4 of K, 2e-6, and 3e-7 of a radian."""
    least = chatter.least_limit(mode)
    cut = Cut(mode, 1.0, np.linspace(*speeds, 12) * RPM, rva, rvf, law)
    axis = np.linspace(0.5, 10, 90) * least
    every = Cut(mode, axis, cut.speed[:, None], rva, rvf, law)
    growth = chatter.floquet(every, 32, 1e-9, 120).growth
    assert np.min(np.abs(growth) / cut.speed[:, None]) > 1e-6  # none of them is in doubt
    assert np.array_equal(chatter.stability_chart(cut, axis), growth < 0)


ISLANDS = [(10_090.45, 3), (13_748.74, 2), (31_517.59, 2), (60_000.0, 2)]


@pytest.mark.parametrize("rpm, borders", ISLANDS)
def test_a_chart_has_its_islands(rpm, borders):
    """Stable again above an unstable stiffness; Hill's matrix counts the multipliers."""
    cut = Cut(RINGING, 1.0, rpm * RPM, 0.2, 0.3)
    axis = np.linspace(0.5, 20, 200) * chatter.least_limit(RINGING)
    stable = chatter.stability_chart(cut, axis)
    assert np.count_nonzero(np.diff(stable)) == borders
    number, sure = unstable_multipliers(cut, axis)
    assert np.mean(sure) > 0.85
    assert np.array_equal(stable[sure], number[sure] == 0)


def test_the_count_of_multipliers_is_that_of_the_roots():
    """At constant speed one pair more crosses at every lobe, the first at the lowest."""
    cut = Cut(MODE, 1.0, 6000 * RPM, 0.0, 0.5)
    limit, _ = chatter.lobes(MODE, cut.speed)
    found, sure = unstable_multipliers(cut, float(limit) * np.array([0.5, 0.97, 1.03, 3.0]))
    assert sure.all()
    assert list(found[:3]) == [0, 0, 2]
    assert found[3] > 2


def test_a_chart_has_the_shape_and_order_of_its_axes():
    cut = Cut(MODE, 1.0, np.array([[9000.0], [4000.0]]) * RPM, [0.1, 0.2, 0.3], 0.5)
    axis = np.array([[4.0, 0.6], [2.0, 4.0]]) * LEAST
    chart = chatter.stability_chart(cut, axis)
    assert chart.shape == (2, 3, 2, 2)
    for i in range(2):
        for k in np.ndindex(2, 2):
            one = replace(cut, cutting_stiffness=axis[k])
            assert np.array_equal(chart[(i, slice(None), *k)], chatter.floquet(one).growth[i] < 0)
    single = chatter.stability_chart(Cut(MODE, 1.0, 4000 * RPM, 0.1, 0.5), 0.6 * LEAST)
    assert single.shape == () and bool(single)


@pytest.mark.parametrize("stiffness", [0.0, [1e6, -1.0], [np.nan]])
def test_a_stiffness_that_is_none_is_refused(stiffness):
    with pytest.raises(ValueError, match=r"cutting_stiffness = .* must lie between 0 and inf"):
        chatter.stability_chart(chatter.HANSON_TSAO2000, stiffness)
