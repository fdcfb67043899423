"""Evaluates layers of motion on a skeleton: samples the rotations of takes along arc length, multiplies them,
and computes the joint positions.

The method follows AniMesh, section 5.
"""
