"""Spacetime trajectories: a banded least-squares problem over all frames, with hard constraints and
locomotion.
"""
