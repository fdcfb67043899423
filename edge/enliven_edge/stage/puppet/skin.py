"""Approximate skinning of a puppet, for physics that only collides with its surface."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.spatial import cKDTree

from enliven.document import Character, SkinWeights

_NEAR = 4
"""Control points that move a vertex: as many as skin weights hold."""
_SHARP = 3.0
"""The power of the distance by which a control point's weight falls: nearest points dominate."""


def roughly_skinned(character: Character) -> Character:
    """Returns a puppet with vertices that follow their nearest control points; other characters unchanged."""
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
