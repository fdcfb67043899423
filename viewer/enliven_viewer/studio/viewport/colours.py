"""The colours of meshes that bring none."""

from __future__ import annotations

import zlib
from dataclasses import replace

import numpy as np

from enliven.document import Character
from enliven_viewer.theme import DEFAULT_COLOURS


def default_colour(shape_id: str) -> tuple[int, int, int]:
    """The sRGB of a mesh without colours of its own, always the same for a name."""
    return DEFAULT_COLOURS[zlib.crc32(shape_id.encode()) % len(DEFAULT_COLOURS)]


def coloured(character: Character) -> Character:
    """The character, in its default colour where the mesh brings none."""
    if character.colours is not None:
        return character
    colour = np.array(default_colour(character.id), np.uint8)
    return replace(character, colours=np.tile(colour, (len(character.vertices), 1)))
