"""Plants, filters and starts that the tests of learning share."""

import pytest

from rcbook import zdomain
from rcbook.loops.learning import Start
from rcbook.machines import lathe
from rcbook.zdomain import Plant

SEEDS = range(4)
SERVO = lathe.LEE_OH_KIM
LAG = Plant([0.5], [1, -0.5], 1, 1.0)
LATE = Plant([0.5, 0.2], [1, -0.9, 0.1], 2, 1.0)
OUTSIDE = Plant([0.3, -0.9, 0.5], [1, -0.5], 1, 1.0)
PLANTS = {"lathe": SERVO.plant, "nc": lathe.LEE_OH_KIM_NC.plant, "late": LATE, "outside": OUTSIDE}
Q1 = zdomain.binomial_q(1)
Q2 = zdomain.symmetric_fir([0.8, 0.1, -0.02])
RESTS = [Start("rest", after) for after in ("itself", "on", "nothing")]
each_plant = pytest.mark.parametrize("plant", PLANTS.values(), ids=PLANTS)
each_seed = pytest.mark.parametrize("seed", SEEDS)
