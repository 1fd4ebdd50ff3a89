"""Face milling in the cutter angle: chip thickness with runout, and the drive it acts upon.

The independent variable is the angle of the cutter, so that samples, teeth and runout keep step
whatever the speed does; time is a state like any other.
"""

from rcbook.machines.face_mill.experiment import Controller, Experiment
from rcbook.machines.face_mill.measures import (
    GROWTH,
    Evenness,
    current_swing,
    current_swings,
    evenness,
    outcome,
    peak_spreads,
    pitch_peaks,
    pitch_torques,
    revolutions_until,
    summary,
    tooth_forces,
    torque_spreads,
    turns_until,
)
from rcbook.machines.face_mill.mill import (
    RPM,
    TSAO_PONG1991,
    TSAO_PONG1991_RANDOM_RUNOUT,
    FaceMill,
    eccentric_runout,
    sampling_angle,
)
from rcbook.machines.face_mill.model import control_model, frequency_response, is_stable
from rcbook.machines.face_mill.printed import (
    last_coefficients,
    printed_controller,
    sampled_digits,
)
from rcbook.machines.face_mill.readings import (
    ENTRIES,
    LIMITS,
    LOGGED,
    MEASURES,
    OUTPUTS,
    TORQUES,
)
from rcbook.machines.face_mill.searches import largest_stable_depth, onset_of_limit, step_errors
from rcbook.machines.face_mill.simulation import Run, simulate, simulate_all
