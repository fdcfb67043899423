"""Matching: which part of a skeleton a pose means (AniMesh, section 4): abstraction, ranking, picking,
symmetry.
"""
