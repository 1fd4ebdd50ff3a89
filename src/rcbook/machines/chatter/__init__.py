"""Regenerative chatter of one mode, at a constant and at a sinusoidally varying spindle speed.

    m x'' + c x' + k x = K (h0 + x(one turn ago) - x),   x positive out of the cut

The grid is equally spaced in spindle ANGLE, so that the delay is always the same whole number of
steps and only the duration of the steps varies: a plant sampled at T(k), as everywhere in the case
study of Hanson and Tsao.
"""

from rcbook.machines.chatter.averaged import averaged_limit, surface_factor
from rcbook.machines.chatter.chart import stability_chart
from rcbook.machines.chatter.constant_speed import least_limit, lobes, rightmost_root
from rcbook.machines.chatter.cut import (
    HANSON_TSAO2000,
    HANSON_TSAO2000_FEED,
    RPM,
    Cut,
    Mode,
    clock,
)
from rcbook.machines.chatter.limits import stability_limit
from rcbook.machines.chatter.multipliers import Floquet, floquet
from rcbook.machines.chatter.simulation import Run, noise, simulate
