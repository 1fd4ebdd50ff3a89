"""The repetitive loop as an object: a process, and round it a controller that remembers.

Signals, with the symbols used throughout::

    r -(+)-> e -> gain C H/(1 - H) -> u -(+)-> controller -> v -(+ w)-> plant -> y
        -^                               -^                                     |
         |--------------------------------|-------------(+ noise)---------------|

r reference, e error, u reference of the inner loop, v command to the plant, w disturbance at the
plant input, y output.  In a *cascade* u is what the repetitive controller makes of e; in the
*plug-in* form r is added to it, and u (with its limit) is the sum.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from rcbook import zdomain
from rcbook.loops.memory import Memory, RepetitiveController, Resonators
from rcbook.zdomain import Plant, add, multiply, shift

FORMS = ("cascade", "plug-in")


@dataclass(frozen=True, eq=False)
class Process:
    """A plant, by itself or under unity feedback through a controller of zero delay."""

    plant: Plant
    controller: Plant | None = None

    def __post_init__(self) -> None:
        if self.plant.delay < 1:
            raise ValueError(
                f"delay = {self.plant.delay}: the plant answers at once, an algebraic loop; "
                "give it one step of delay"
            )
        if self.controller is None:
            return
        if self.controller.delay != 0:
            raise ValueError(f"controller delay {self.controller.delay}: put it into its b instead")
        if not np.isclose(self.controller.dt, self.plant.dt, rtol=1e-9, atol=0):
            raise ValueError(
                f"controller at {self.controller.dt} s, plant at {self.plant.dt} s; "
                "sample both at the same interval"
            )

    @cached_property
    def command_path(self) -> Plant:
        """From command to output; under feedback the closed loop, nothing cancelled."""
        n, c, feedback = self.parts
        forward = multiply(shift(self.plant.b, self.plant.delay), n)
        denominator = add(multiply(c, self.plant.a), feedback * forward)
        return Plant(multiply(n, self.plant.b), denominator, self.plant.delay, self.plant.dt)

    @cached_property
    def disturbance_path(self) -> Plant:
        """From a disturbance at the plant input to the output."""
        _, c, _ = self.parts
        path = self.command_path
        return Plant(multiply(c, self.plant.b), path.a, path.delay, path.dt)

    @property
    def parts(self) -> tuple[np.ndarray, np.ndarray, int]:
        """n, c and feedback of v = n (u - feedback y)/c."""
        if self.controller is None:
            return np.ones(1), np.ones(1), 0
        return self.controller.b, self.controller.a, 1


def pi_controller(gain: float, alpha: float, dt: float) -> Plant:
    """PI controller gain (1 + alpha z^-1/(1 - z^-1)); alpha gain is the integral gain per sample.

    Source: Horng (1989), eqs 9-10.  Raises ValueError for a gain of zero, or one not finite.
    """
    gain, alpha = zdomain.real_number(gain, "gain"), zdomain.real_number(alpha, "alpha")
    if gain == 0:
        raise ValueError("gain = 0: a controller that does nothing; leave it out")
    return Plant([gain, gain * (alpha - 1)], [1.0, -1.0], 0, dt)


@dataclass(frozen=True, eq=False)
class Loop:
    """A process with a controller that remembers round it or, without one, fed by the reference.

    `model` is the process on which the controller was designed; None: unknown, or the same.
    `dataclasses.replace(loop, process=machine)` puts the same controller on another machine.
    """

    process: Process  # or a Plant, which becomes a process by itself
    repetitive: RepetitiveController | Resonators | None = None
    form: str = "cascade"
    model: Process | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "process", _as_process(self.process))
        if self.model is not None:
            object.__setattr__(self, "model", _as_process(self.model))
        if self.form not in FORMS:
            raise ValueError(f"form {self.form!r} is none of {', '.join(FORMS)}")

    @property
    def dt(self) -> float:
        """Sampling interval in s."""
        return self.process.plant.dt

    @property
    def period(self) -> float | None:
        """Samples that the controller remembers; None without one."""
        return None if self.repetitive is None else self.repetitive.period

    @property
    def look_ahead(self) -> float:
        """Samples by which the controller looks ahead of a period ago; 0 without a memory."""
        remembers = isinstance(self.repetitive, RepetitiveController)
        return self.repetitive.look_ahead if remembers else 0

    def with_gain(self, gain: float) -> Loop:
        """The same loop at another repetitive gain.  Raises ValueError when it has none."""
        return replace(self, repetitive=replace(self.require_controller(), gain=gain))

    def require_controller(self) -> RepetitiveController | Resonators:
        """The repetitive controller.  Raises ValueError when there is none."""
        if self.repetitive is None:
            raise ValueError("the loop has no repetitive controller; make one with `design`")
        return self.repetitive

    @property
    def parts(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """n, d and through of u = (through r + n e)/d."""
        if self.repetitive is None:
            return np.zeros(1), np.ones(1), np.ones(1)
        numerator, denominator = self.repetitive.numerator, self.repetitive.denominator
        return numerator, denominator, denominator * (self.form == "plug-in")

    @cached_property
    def open_polynomials(self) -> tuple[np.ndarray, np.ndarray]:
        """d and n of the characteristic polynomial d + n; n is proportional to the gain."""
        numerator, denominator, _ = self.parts
        path = self.process.command_path
        return multiply(path.a, denominator), multiply(path.numerator, numerator)

    @cached_property
    def roots(self) -> np.ndarray:
        """Closed-loop roots a sample, by decreasing magnitude."""
        return zdomain.sorted_roots(characteristic_polynomial(self)).astype(complex)


def as_loop(system: Loop | Process | Plant) -> Loop:
    """The loop itself, or a process or plant fed by the reference.  Raises TypeError otherwise."""
    return system if isinstance(system, Loop) else Loop(_as_process(system))


def _as_process(system: Process | Plant) -> Process:
    if isinstance(system, Plant):
        return Process(system)
    if not isinstance(system, Process):
        raise TypeError(f"{system!r} is no plant, process or loop; make one with `Plant`")
    return system


def design(
    process: Process | Plant,
    memory: Memory | float,
    gain: float,
    radius: float = 1.0,
    normalisation: str = "peak",
    form: str = "cascade",
) -> Loop:
    """The loop whose compensator is the zero-phase inverse of the process, kept as its model.

    `memory` is a Memory or a period in samples.
    Source: Horng (1989), eqs 15 and 18.  Raises ValueError as `zdomain.zero_phase_inverse` and
    `RepetitiveController` do, TypeError as `memory.as_memory` does.
    """
    process = _as_process(process)
    inverse = zdomain.zero_phase_inverse(process.command_path, radius, normalisation)
    return Loop(process, RepetitiveController(inverse, memory, gain), form, process)


def characteristic_polynomial(loop: Loop | Process | Plant) -> np.ndarray:
    """Exact closed-loop polynomial in z^-1, every mode of process and controller kept."""
    return add(*as_loop(loop).open_polynomials)
