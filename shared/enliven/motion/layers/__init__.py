"""Layers of motion on a skeleton: turns along arc length, sampled, multiplied and placed (AniMesh, section
5).
"""
