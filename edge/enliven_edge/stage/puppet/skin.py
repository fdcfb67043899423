"""Roughly where the surface of a puppet is, without solving it: for what only needs to bump into it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.spatial import cKDTree

from enliven.document import Character, SkinWeights

_NEAR = 4
_SHARP = 3.0
"""How fast a control point counts for less with the distance: its power."""


def roughly_skinned(character: Character) -> Character:
    """A puppet whose vertices follow their nearest control points; other characters as they are."""
    if character.kind != "points" or len(character.pivots) < 2:
        return character
    near = min(_NEAR, len(character.pivots) - 1)
    away, which = cKDTree(character.pivots[1:]).query(character.vertices, k=np.arange(1, near + 1))
    counts = 1.0 / np.maximum(away, 1e-6) ** _SHARP
    indices = np.zeros((len(character.vertices), 4), np.uint16)
    weights = np.zeros((len(character.vertices), 4), np.float32)
    indices[:, :near] = which + 1
    weights[:, :near] = counts / counts.sum(1, keepdims=True)
    skin = SkinWeights(indices, weights)
    return replace(character, kind="bones", skin=skin, held=None, pulls=None, surface=None)
