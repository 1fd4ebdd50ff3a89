"""The loop sample by sample, many samples at once: a triangular system, banded and solved as such.

A sample has three unknowns, in the order in which they come about: y, then the u and the v asked
for, before their limits.  Each is a sum over earlier ones, so a run is a triangular system; what
the memory recalls from beyond the band is known before a stretch of samples is solved.
A limit changes what a clipped signal acts with.  Where one acts is guessed, from a period ago, and
the stretch is solved; all is right up to the first wrong guess, and there the next one begins.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg.blas import dtbmv, dtbsv

from rcbook.loops.repetitive.loop import Loop
from rcbook.loops.run import Limits

_STRETCH = 512  # samples solved at once at most
_SHORTEST = 128  # and at least, where guesses go wrong: later ones are put right as well
Blocks = dict[tuple[int, int], np.ndarray]  # what a row takes of an unknown, as a polynomial


@dataclass(frozen=True, eq=False)
class _System:
    """Rows of the arrays are columns of the band, which BLAS wants to lie one behind the other."""

    reach: int  # samples by which the band goes back; as many known ones stand before a stretch
    band: np.ndarray
    limited: np.ndarray | None  # the part of it that acts with what a limit leaves
    far: int  # the longest lag beyond the band, samples
    recalled: np.ndarray  # places there, one row a sample, counted in unknowns from the longest lag
    weights: np.ndarray

    @property
    def stretch(self) -> int:
        """Samples solved at once."""
        return self.band.shape[0] // 3 - self.reach


def signals(
    loop: Loop, inputs: Sequence[np.ndarray], limits: Limits, bound: float
) -> tuple[np.ndarray, np.ndarray]:
    """y, u and v from rest, and at what a limit holds each, else 0; (3, n), and (3, 0) if free.

    `inputs` are reference, disturbance and noise, of n samples each.  What follows soon after a
    sample beyond `bound` means nothing.
    """
    system = _system(loop, limits)
    start = max(system.reach, system.far)
    known = np.zeros((start + inputs[0].size, 3))
    known[start:] = _known(loop, inputs)
    with np.errstate(all="ignore"):
        if system.limited is None:
            sent, held = _free(system, known, start, bound), known[:0]
        else:
            sent, held = _limited(system, known, start, bound, limits, loop.period or 1)
    return np.ascontiguousarray(sent[start:].T), held[start:].T


def _free(system: _System, known: np.ndarray, start: int, bound: float) -> np.ndarray:
    """The unknowns in place of what is known."""
    while start < known.shape[0] and np.abs(known[start - 1]).max() <= bound:
        stop = min(start + system.stretch, known.shape[0])
        known[start:stop, 1] -= _recalled(system, known, start, stop)
        _solve(system, known[start - system.reach : stop])
        start = stop
    return known


def _limited(
    system: _System, known: np.ndarray, start: int, bound: float, limits: Limits, period: float
) -> tuple[np.ndarray, np.ndarray]:
    most = np.array([np.inf, limits.repetitive.value, limits.command.value])
    most = np.tile(most, (system.stretch, 1))
    asked, sent, held = np.zeros((3, *known.shape))
    kept = sent if limits.repetitive.remember_clipped else asked
    size, period, guessed = system.stretch, max(1, round(period)), start
    while start < known.shape[0] and np.abs(sent[start - 1]).max() <= bound:
        stop, first = min(start + size, known.shape[0]), start - system.reach
        if guessed < stop:
            last = held[max(guessed - period, 0) : guessed][: stop - guessed]
            held[guessed:stop] = np.resize(last, (stop - guessed, 3))
            guessed = stop
        right = np.concatenate([asked[first:start], known[start:stop]])
        right[system.reach :, 1] -= _recalled(system, kept, start, stop)
        found = _solve(system, right, held[first:stop])[system.reach :]
        within = most[: stop - start]
        clipped = np.minimum(np.maximum(found, -within), within)
        acts = np.where(np.abs(found) > within, clipped, 0.0)
        wrong = np.flatnonzero(acts != held[start:stop])
        done = (wrong[0] + 1) // 3 if wrong.size else stop - start
        asked[start : start + done], sent[start : start + done] = found[:done], clipped[:done]
        held[start:stop] = acts
        start, size = start + done, min(system.stretch, max(4 * done, _SHORTEST))
    return sent, held


def _recalled(system: _System, kept: np.ndarray, start: int, stop: int) -> np.ndarray | float:
    """What the memory recalls from beyond the band, for samples start to stop."""
    if not system.far:
        return 0.0
    return kept[start - system.far :].ravel()[system.recalled[: stop - start]] @ system.weights


def _solve(system: _System, right: np.ndarray, held: np.ndarray | None = None) -> np.ndarray:
    """Samples of known ones and right sides, which are overwritten, as samples of unknowns."""
    right, band = right.reshape(-1), system.band[: right.size]
    reach = band.shape[1] - 1
    if held is None or not held.any():
        return dtbsv(reach, band.T, right, lower=1, diag=1, overwrite_x=1).reshape(-1, 3)
    limited, at = system.limited[: right.size], np.flatnonzero(held)
    right -= dtbmv(reach, limited.T, held.reshape(-1), lower=1)
    whole = band[at]
    band[at] = whole - limited[at]
    found = dtbsv(reach, band.T, right, lower=1, diag=1, overwrite_x=1)
    band[at] = whole
    return found.reshape(-1, 3)


# ---- the system ----


def _system(loop: Loop, limits: Limits) -> _System:
    (ng, dg, _), (n, c, feedback) = loop.parts, loop.process.parts
    asked = {(0, 0): loop.process.plant.a, (1, 0): ng / dg[0], (2, 0): feedback * n / c[0]}
    sent = {(0, 2): -loop.process.plant.numerator, (2, 1): -n / c[0]}
    (sent if limits.repetitive.remember_clipped else asked)[1, 1] = dg / dg[0]
    (sent if limits.command.remember_clipped else asked)[2, 2] = c / c[0]
    lags = np.union1d(np.flatnonzero(ng), np.flatnonzero(dg))
    # ns a sample: the band grows with its reach, and a call comes once in a stretch
    split = np.argmin(0.85 * lags + 12000 / np.append(lags[1:], 1e9))
    near = [loop.process.plant.a, loop.process.plant.numerator, n, c]
    reach = max(1, lags[split], *(p.size - 1 for p in near))
    far = lags[-1] if split + 1 < lags.size else 0
    stretch = min(_STRETCH, lags[split + 1]) if far else _STRETCH
    free = limits.command.value == limits.repetitive.value == np.inf
    band = _band(asked | sent, reach, stretch)
    limited = None if free else _band(sent, reach, stretch)
    places, weights = [], []
    for unknown, p in enumerate((ng, dg)):
        at = np.flatnonzero(p[reach + 1 :]) + reach + 1 if far else np.zeros(0, int)
        places.append(3 * (far - at) + unknown)
        weights.append(p[at] / dg[0])
    recalled = 3 * np.arange(stretch)[:, None] + np.concatenate(places)
    return _System(reach, band, limited, far, recalled, np.concatenate(weights))


def _band(blocks: Blocks, reach: int, stretch: int) -> np.ndarray:
    columns = np.zeros((3, 3 * reach + 3))
    for (row, unknown), p in blocks.items():
        at = 3 * np.arange(min(p.size, reach + 1)) + row - unknown
        columns[unknown, at[at > 0]] = p[: at.size][at > 0]
    band = np.empty((reach + stretch, *columns.shape))
    band[:] = columns
    band = band.reshape(-1, 3 * reach + 3)
    for i in range(3 * reach):  # what is known is not to be solved for
        band[i, : 3 * reach - i] = 0
    return band


def _known(loop: Loop, inputs: Sequence[np.ndarray]) -> np.ndarray:
    """What the inputs alone add to each row, (n, 3)."""
    r, w, noise = inputs
    (ng, dg, through), (n, c, feedback) = loop.parts, loop.process.parts
    controlled = _sum(ng, r - noise) + _sum(through, r)
    rows = (_sum(loop.process.plant.numerator, w), controlled / dg[0])
    return np.column_stack([*rows, -feedback / c[0] * _sum(n, noise)])


def _sum(p: np.ndarray, s: np.ndarray) -> np.ndarray:
    """p(z^-1) s from rest, piece by piece of what a long p has between its zeros."""
    out, lags = np.zeros(s.size), np.flatnonzero(p[: s.size])
    if s.any() and lags.size:
        for at in np.split(lags, np.flatnonzero(np.diff(lags) > 1) + 1):
            rest = s.size - at[0]
            out[at[0] :] += np.convolve(p[at[0] : at[-1] + 1], s[:rest])[:rest]
    return out
