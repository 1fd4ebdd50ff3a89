"""Reproducible case studies in repetitive and learning control of machine tools."""

__version__ = "0.1.0"

# The house, from the ground up: rooms of a floor import from floors below it, and rooms of one
# floor do not know each other.
FLOORS = (
    ("spread", "zdomain", "ledger"),
    ("signals",),
    ("identify", "loops", "machines"),
    ("comparison",),
    ("pictures",),
    ("book",),
    ("cli",),
)
