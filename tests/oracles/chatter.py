"""Chatter by the argument principle, and by Newton's method on Hill's matrix.

The clock of the spindle is the library's; its own test holds it against the speed law.
"""

import itertools
from dataclasses import replace

import numpy as np

from rcbook.machines.chatter import clock


def characteristic(mode, stiffness, tau, s):
    """m s^2 + c s + k + K (1 - e^(-s tau)), whose zeros are the roots."""
    return mode.mass * s**2 + mode.damping * s + mode.stiffness + stiffness * (1 - np.exp(-s * tau))


def roots_right_of(mode, stiffness, tau, real, n=200_001):
    """Number of characteristic roots to the right of a vertical line, by the argument principle.

    Beyond four times the natural frequency m s^2 outweighs all other terms.
    """
    top = 4 * mode.natural_frequency
    corners = [real - 1j * top, top - 1j * top, top + 1j * top, real + 1j * top, real - 1j * top]
    sides = [np.linspace(a, b, n) for a, b in itertools.pairwise(corners)]
    phase = np.unwrap(np.angle(characteristic(mode, stiffness, tau, np.concatenate(sides))))
    return round((phase[-1] - phase[0]) / (2 * np.pi))


def hill(cut, sigma, harmonics):
    """Hill's matrix of one cut and its derivative, for x = e^(sigma theta) sum a_j e^(j rvf theta).

    In angle the delay is exactly one turn, e^(-2 pi D), and d/dt is speed d/dtheta, W D.
    """
    mode, stiffness, rvf = cut.mode, float(cut.cutting_stiffness), float(cut.rvf)
    j = np.arange(-harmonics, harmonics + 1)
    grid = 2 * np.pi / rvf * np.arange(1024) / 1024
    fourier = np.fft.fft(clock(cut, grid)[1]) / 1024
    w = fourier[(j[:, None] - j) % 1024] * (np.abs(j[:, None] - j) < 400)
    d, echo = np.diag(sigma + 1j * rvf * j), np.exp(-2 * np.pi * (sigma + 1j * rvf * j))
    wd, eye = w @ d, np.eye(j.size)
    matrix = mode.mass * wd @ wd + mode.damping * wd + mode.stiffness * eye
    matrix += stiffness * (eye - np.diag(echo))
    slope = mode.mass * (w @ wd + wd @ w) + mode.damping * w + 2 * np.pi * stiffness * np.diag(echo)
    return matrix, slope


def exact_exponent(cut, near, harmonics=110):
    """Floquet exponent (1/rad) nearest to a guess, by Newton's method on Hill's matrix.

    A multiplier of whole turns leaves the imaginary part open by whole numbers below rvf.
    """
    found = []
    for start in near + 1j * np.arange(np.ceil(cut.rvf)):
        now = start
        for _ in range(6):
            matrix, slope = hill(cut, now, harmonics)
            pencil = np.linalg.eigvals(np.linalg.solve(matrix, slope))
            step = 1 / pencil[np.argmax(np.abs(pencil))]
            now = now - step
            if abs(step) < 1e-9:
                found.append(now - start + near)
                break
    return min(found, key=lambda exact: abs(exact - near))


def unstable_multipliers(cut, stiffness, harmonics=60, phases=96):
    """Number of multipliers outside of the unit circle at each stiffness: argument principle.

    Hill's matrix is A + K B, so that the eigenvalues of B/A on the circle count them for every K:
    det(I + K B/A) has no pole outside, and turns once round the origin for each of its zeros there.
    Also whether the phase was followed in steps below 2.5 rad; else one lies too near the circle.
    """
    bare = replace(cut, cutting_stiffness=1e-12 * cut.mode.stiffness)
    sigma = 0.5j * float(cut.rvf) * (np.arange(phases) + 0.5) / phases  # half of the circle
    loci = []
    for s in sigma:
        a, _ = hill(bare, s, harmonics)
        echo = np.exp(-2 * np.pi * (s + 1j * float(cut.rvf) * np.arange(-harmonics, harmonics + 1)))
        loci.append(np.linalg.eigvals(np.linalg.solve(a, np.diag(1 - echo))))
    factors = 1 + np.asarray(stiffness)[:, None, None] * np.array(loci)
    half = np.angle(factors).sum(axis=-1)
    circle = np.concatenate([half, -half[:, ::-1], half[:, :1]], axis=1)
    steps = (np.diff(circle, axis=1) + np.pi) % (2 * np.pi) - np.pi
    number = -np.rint(steps.sum(axis=1) / (2 * np.pi)).astype(int)
    return number, np.abs(steps).max(axis=1) < 2.5
