"""The colours of meshes that bring none."""

from __future__ import annotations

import zlib
from dataclasses import replace

import numpy as np

from enliven.document import Character
from enliven_viewer.studio.viewport.theme import CLAYS


def clay_of(shape_id: str) -> tuple[int, int, int]:
    """The sRGB of a mesh that brings no colours: always the same for a name."""
    return CLAYS[zlib.crc32(shape_id.encode()) % len(CLAYS)]


def coloured(character: Character) -> Character:
    """The character, in its clay where it has no colours."""
    if character.colours is not None:
        return character
    clay = np.array(clay_of(character.id), np.uint8)
    return replace(character, colours=np.tile(clay, (len(character.vertices), 1)))
