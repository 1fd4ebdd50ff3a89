"""What every loop is asked, in one vocabulary: the verdict, and the names of its signals."""

from __future__ import annotations

from dataclasses import dataclass

SOURCES = ("reference", "disturbance", "noise")
OUTPUTS = ("output", "error", "measured_error", "command", "repetitive")
MARGIN = 1e-9  # a spectral radius, a sample, this close to one is rounding's to decide


@dataclass(frozen=True)
class Verdict:
    """What is known about the stability of a loop, and on what grounds."""

    verdict: str  # "stable", "unstable" or "undecided"
    method: str
    certificate: str
    outside: int | None = None  # multipliers of magnitude above one, where known

    def __str__(self) -> str:
        return f"{self.verdict} ({self.method}: {self.certificate})"


def judged(radius: float, method: str, certificate: str, outside: int | None = None) -> Verdict:
    """The verdict that follows from an exact spectral radius; within 1e-9 of one is "undecided"."""
    verdict = "stable" if radius < 1 - MARGIN else "unstable"
    if abs(radius - 1) <= MARGIN:
        verdict, outside = "undecided", None
    return Verdict(verdict, method, certificate, outside)


def require_stable(verdict: Verdict, mend: str) -> None:
    """Raise ValueError, with grounds and mend, unless the verdict is "stable"."""
    if verdict.verdict != "stable":
        raise ValueError(f"the loop is {verdict}: it has no steady state; {mend}")


def require_ends(output: str, source: str) -> None:
    """Raise ValueError unless `output` and `source` name signals of a loop."""
    if source not in SOURCES or output not in OUTPUTS:
        raise ValueError(f"{source!r} to {output!r}: sources {SOURCES}, outputs {OUTPUTS}")
