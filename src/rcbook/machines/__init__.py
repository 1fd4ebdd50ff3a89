"""Machines: physics and the parameter sets of the papers."""
