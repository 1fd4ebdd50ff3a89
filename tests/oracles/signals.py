"""Measures by their definition, read aloud."""

import numpy as np


def loop_settling(y, target, band, dt):
    """The definition, read aloud: try every sample as the first settled one."""
    for k in range(len(y)):
        if all(abs(value - target) <= band for value in y[k:]):
            return k * dt
    return np.inf
