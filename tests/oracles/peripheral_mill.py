"""The mill of the thesis by its recursion, and its modes in continuous time."""

import control
import numpy as np

EXACT = np.roots([1, -0.7537, -0.2404])  # poles of eq. 7


def recursion(v):
    """Force in lb after equation 8, for speed commands in mV."""
    force = np.zeros(len(v))
    for k in range(len(v)):
        force[k] = 0.7537 * force[k - 1] * (k > 0) + 0.2404 * force[k - 2] * (k > 1)
        force[k] += 9.0452 * v[k - 1] * (k > 0) - 7.8975 * v[k - 2] * (k > 1)
    return force


def continuous_modal_system(plant):
    """sum of g_i (1 - mode_i(t)): a lag for the slow pole, a damped cosine for the other."""
    b0, b1 = plant.b
    slow, fast = max(EXACT), min(EXACT)
    gains = [(b0 * p + b1) / (p - other) / (1 - p) for p, other in ((slow, fast), (fast, slow))]
    # t = 0: g1 + g2 - g1 - g2 = 0; mode of p is e^(t ln|p|/T) cos(pi t/T) when p < 0
    sigma1, sigma2, omega = np.log(slow) / plant.dt, np.log(-fast) / plant.dt, np.pi / plant.dt
    # step response 1 - e^(s t) cos(w t) has the transfer 1 - s (s - sigma)/((s - sigma)^2 + w^2)
    lag = control.tf([-sigma1], [1, -sigma1])
    cosine = control.tf([-sigma2, sigma2**2 + omega**2], [1, -2 * sigma2, sigma2**2 + omega**2])
    return gains[0] * control.ss(lag) + gains[1] * control.ss(cosine)


def step_with_a_sine_part(plant, rate, sine, n):
    """n samples of the step response of the modes in continuous time, taken at `rate` in Hz."""
    slow, fast = plant.poles
    gains = [
        float(np.polyval(plant.b[::-1], 1 / p) / (1 - q / p) / (1 - p))
        for p, q in ((slow, fast), (fast, slow))
    ]
    t = np.arange(n) * 60 / rate  # in intervals of 1/60 s
    swing = np.abs(fast) ** t * (np.cos(np.pi * t) + sine * np.sin(np.pi * t))
    return gains[0] * (1 - slow**t) + gains[1] * (1 - swing)
