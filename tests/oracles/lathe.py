"""Sections by the area that they enclose."""

import itertools

import numpy as np
import scipy.integrate


def area(section, sides):
    """Half the integral of r^2, piece by piece between the corners of polygons of these sides."""
    kinks = sorted({np.pi * (2 * k + 1) / n % (2 * np.pi) for n in sides for k in range(n)})
    edges = [0.0, *kinks, 2 * np.pi]
    pieces = itertools.pairwise(edges)
    return sum(scipy.integrate.quad(lambda t: section(t) ** 2 / 2, a, b)[0] for a, b in pieces)
