"""Polynomials term by term, peaks by search, and sampling by other algorithms."""

import decimal
import math
from decimal import Decimal
from fractions import Fraction

import numpy as np
import scipy.linalg
import scipy.optimize


def from_roots(roots):
    """Monic polynomial, term by term and without np.poly."""
    p = [1.0 + 0j]
    for root in roots:
        p = [a - root * b for a, b in zip([*p, 0], [0, *p], strict=True)]
    return np.array(p).real


def value(p, z):
    """p(z^-1) by powers, not by Horner's rule."""
    return sum(c * z ** (-float(i)) for i, c in enumerate(p))


def peak_square(p):
    """Maximum of |p|^2 on the circle: a dense grid, then a bounded search round its top."""
    w = np.linspace(0, np.pi, 4001)

    def negative(x):
        return -(abs(value(p, np.exp(1j * x))) ** 2)

    best = max(-negative(w))
    for x in w[np.argsort(negative(w))[:3]]:
        found = scipy.optimize.minimize_scalar(
            negative, bounds=(x - 1e-3, x + 1e-3), method="bounded", options={"xatol": 1e-10}
        )
        best = max(best, -found.fun)
    return best


def with_integral(system):
    """The system and, as its last state, the integral of its output."""
    n = system.nstates
    a = np.block([[system.A, np.zeros((n, 1))], [system.C, np.zeros((1, 1))]])
    return a, np.append(system.B, [[0]], axis=0)


def two_lags(fast, slow, dt):
    """1/((s + fast)(s + slow)) held and integrated: b and a by its closed form in 80 digits."""
    with decimal.localcontext(prec=80):
        rates, dt = [Decimal(fast), Decimal(slow)], Decimal(dt)
        gains = [1 / (rates[1] - rates[0]), 1 / (rates[0] - rates[1])]
        decays = [(-p * dt).exp() for p in rates]
        # a lag g/(s + p): g/p (1 - e^-pt), integrated g/p (t - (1 - e^-pt)/p)
        at_once = [g / p * (dt - (1 - e) / p) for g, p, e in zip(gains, rates, decays, strict=True)]
        later = [g / p**2 * (1 - e) ** 2 for g, p, e in zip(gains, rates, decays, strict=True)]
        b = [
            sum(at_once),
            sum(later) - sum(at_once) * sum(decays),
            sum(at_once) * decays[0] * decays[1] - later[0] * decays[1] - later[1] * decays[0],
        ]
        return [float(x) for x in b], [1.0, -float(sum(decays)), float(decays[0] * decays[1])]


def exponential_series(x, first):
    """sum of x^k/(k + first)! in exact fractions of the complex number x."""
    re, im = Fraction(x.real), Fraction(x.imag)
    power, total = (Fraction(1), Fraction(0)), [Fraction(0), Fraction(0)]
    for k in range(60):
        total = [t + p / math.factorial(k + first) for t, p in zip(total, power, strict=True)]
        power = (power[0] * re - power[1] * im, power[0] * im + power[1] * re)
    return complex(*map(float, total))


def interval_integrals(system, dt, u):
    """What the output integrates to over each interval of held inputs u, by matrix exponentials."""
    a, b = with_integral(system)
    whole = scipy.linalg.expm(dt * np.block([[a, b], [np.zeros((1, len(a) + 1))]]))
    state, integrals = np.zeros(len(a)), []
    for value in u:
        after = (whole @ [*state, value])[:-1]
        integrals.append(after[-1] - state[-1])
        state = after
    return integrals


def held_in_decimals(system, dt, digits=80):
    """Impulse response h(0) .. h(n), numerator and denominator behind a zero-order hold: series and
    doubling of the matrix exponential and the polynomial by Faddeev and Leverrier, in decimals."""
    n, exact = system.nstates, np.vectorize(lambda x: Decimal(float(x)), otypes=[object])
    with decimal.localcontext(prec=digits):
        joint = exact(np.block([[system.A, system.B], [np.zeros((1, n + 1))]])) * Decimal(float(dt))
        halvings = int(np.abs(joint).sum()).bit_length() + 4
        term = moved = joint / 2**halvings
        for k in range(2, 45):
            term = term @ (joint / 2**halvings) / k
            moved = moved + term
        for _ in range(halvings):
            moved = 2 * moved + moved @ moved
        a, state, c = moved[:n, :n] + exact(np.eye(n)), moved[:n, n], exact(system.C[0])
        impulse = [Decimal(system.D.item())]
        for _ in range(n):
            impulse.append(c @ state)
            state = a @ state
        poles, power = [Decimal(1)], 0 * a
        for k in range(1, n + 1):
            power = a @ power + poles[-1] * exact(np.eye(n))
            poles.append(-np.trace(a @ power) / k)
        zeros = [sum(poles[i] * impulse[k - i] for i in range(k + 1)) for k in range(n + 1)]
        return [np.array(each, dtype=float) for each in (impulse, zeros, poles)]
