"""The repetitive loop: a controller that remembers one period, round a process.

`loop` puts it together, `stability` judges it, `response` runs it, `search` looks for gains that
will do; what all loops share, memories and limits among it, is handed on.
"""

from rcbook.loops.memory import (
    Memory,
    RepetitiveController,
    Resonators,
    gain_bound,
    lead,
    odd_harmonic,
    plain,
    resonators,
    several,
)
from rcbook.loops.repetitive.loop import (
    FORMS,
    Loop,
    Process,
    as_loop,
    characteristic_polynomial,
    design,
    pi_controller,
)
from rcbook.loops.repetitive.radii import spectral_radii
from rcbook.loops.repetitive.response import (
    frequency_response,
    noise_gain,
    respond,
    sensitivity,
    simulate,
    steady_state,
    transfer,
)
from rcbook.loops.repetitive.search import (
    acceptable_gains,
    meeting_gains,
    swings,
)
from rcbook.loops.repetitive.stability import (
    controller_gains,
    factor,
    gain_limit,
    mismatch,
    require_stable,
    roots,
    spectral_radius,
    stable_gains,
    unstable_roots,
    verdict,
)
from rcbook.loops.run import Limit, Limits, Run
from rcbook.loops.verdict import OUTPUTS, SOURCES, Verdict
