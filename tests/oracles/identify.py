"""Records of a plant, sum by sum."""

import numpy as np


def difference_equation(a, b, delay, u, equation_noise=None):
    """y from a y = q^-delay b u + e, sum by sum."""
    y = np.zeros(len(u))
    for k in range(len(u)):
        past = sum(-a[i] * y[k - i] for i in range(1, len(a)) if k >= i)
        drive = sum(b[i] * u[k - delay - i] for i in range(len(b)) if k >= delay + i)
        y[k] = past + drive + (0.0 if equation_noise is None else equation_noise[k])
    return y
