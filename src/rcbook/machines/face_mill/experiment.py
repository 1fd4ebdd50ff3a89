"""One cut in simulation, and what it asks of a controller."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from rcbook.machines.face_mill.mill import FaceMill
from rcbook.machines.face_mill.readings import (
    ENTRIES,
    LIMITS,
    MEASURES,
    OUTPUTS,
    TORQUES,
    one_of,
)
from rcbook.zdomain import whole_number


class Controller(Protocol):
    """What may control an experiment: any object with a causal `numerator` and `denominator`.

    Both are 1-D arrays or sequences of real coefficients in z^-1, lowest power first, and the first
    of the denominator is not zero.  Once per sample, every `sampling_angle`, it is given the
    nominal value minus the measured one, in N (or N m), and answers with what is added to the
    speed command, in V.  A `rcbook.loops.repetitive.RepetitiveController` is one, a
    `rcbook.zdomain.Plant` is one, and so is a name for two polynomials::

        leak = Plant(b=[-1e-4], a=[1, -0.9], delay=1, dt=sampling_angle(mill))
        run = simulate(Experiment(mill, controller=leak))
    """

    @property
    def numerator(self) -> np.ndarray: ...

    @property
    def denominator(self) -> np.ndarray: ...


@dataclass(frozen=True)
class Experiment:
    """One cut in simulation: the mill, its controller, and a reading of what the paper leaves open.

    The spindle turns freely at nominal speed before the turn `engaged` and the controller is idle
    before the turn `controlled`, both counted from 1.  Per sample the controller sees the nominal
    value minus what `measure` makes of the largest tooth force, or of the cutting torque:
    the value at the instant, or the largest over the last sampling interval or tooth pitch.
    Teeth that stand in the cut at engagement cut "at once", or each from its next entry on, "one by
    one".  `torque` computes the load with the memory of eq. 8 or from the speed of the instant.
    `keep_negative` lets a chip thickness below zero push.  The current limit acts on the current
    command, with the velocity integral running on ("clamp") or stopped ("hold") meanwhile.
    Raises ValueError for another word than these and numbers that are no whole ones, and TypeError
    for a controller that is no `Controller`.
    """

    mill: FaceMill
    controller: Controller | None = None
    controlled: int = 6
    engaged: int = 2
    turns: int = 16
    output: str = "force"
    measure: str = "sample"
    entry: str = "one by one"
    torque: str = "memory"
    keep_negative: bool = False
    limit: str = "clamp"
    substeps: int = 12  # steps of integration per sample
    inner: int = 1  # points of every step at which extremes of the current are looked for

    def __post_init__(self) -> None:
        for name in ("controlled", "engaged", "turns", "substeps", "inner"):
            object.__setattr__(self, name, whole_number(getattr(self, name), name))
        for name, allowed in (
            ("output", OUTPUTS),
            ("measure", MEASURES),
            ("entry", ENTRIES),
            ("torque", TORQUES),
            ("limit", LIMITS),
        ):
            one_of(getattr(self, name), allowed, name)
        for name in ("numerator", "denominator"):
            if self.controller is not None and not hasattr(self.controller, name):
                raise TypeError(
                    f"controller {self.controller!r} has no {name}; give an object with numerator "
                    "and denominator in z^-1, such as a zdomain.Plant"
                )

    @property
    def steps_per_turn(self) -> int:
        """Steps of integration per turn of the cutter."""
        return self.mill.samples_per_turn * self.substeps

    @property
    def target(self) -> float:
        """Nominal value of the output, in N or N m, that the controller holds."""
        return self.mill.nominal_force if self.output == "force" else self.mill.nominal_torque
