"""Layers of motion on a skeleton: samples the rotations of takes along arc length, multiplies them, and
places the result.

The method follows AniMesh, section 5.
"""
