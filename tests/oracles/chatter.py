"""Chatter by the argument principle, and by Newton's method on Hill's matrix.

The clock of the spindle is the library's; its own test holds it against the speed law.
"""

import itertools

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
