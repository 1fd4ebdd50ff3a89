"""Loops that learn from the past: one idea in three rooms.

`memory` holds what they share; `repetitive`, `learning` and `periodic` are namespaces with the same
verbs: factor, verdict, spectral_radius, simulate, steady_state, noise_gain.
"""
