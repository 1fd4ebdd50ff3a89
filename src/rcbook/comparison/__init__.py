"""Unlike controllers on one machine, made comparable: rivals, margins, one rule of tuning.

`rivals` are controllers without a memory of a period, `margins` say what a loop forgives, `tuning`
is the rule, `varying` closes a rival round a plant whose intervals vary, and `measures` are asked
of every loop.
"""
