"""Spacetime optimization of trajectories: a banded least-squares problem over all frames, with hard
constraints and locomotion.
"""
