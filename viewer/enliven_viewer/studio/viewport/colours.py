"""The render meshes of characters, with default colours."""

from __future__ import annotations

import zlib
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from enliven.document import Character, RigBase
from enliven.modeling.edits import get_rig_edits
from enliven_viewer.theme import DEFAULT_COLOURS, Paint, get_theme


def choose_default_colour(character_id: str) -> Paint:
    """Returns the sRGB colour for a mesh without colours. It depends only on the character's id."""
    colour: Paint = DEFAULT_COLOURS[zlib.crc32(character_id.encode()) % len(DEFAULT_COLOURS)]
    return colour


class DrawnMeshes:
    """A cache of the render meshes of characters. It returns the same object until the rest surface changes.

    Args:
        draw: creates a render mesh; by default through the character's rig.
    """

    def __init__(self, draw: Callable[[RigBase], Character] | None = None) -> None:
        self._make_mesh = draw or (lambda character: get_rig_edits(character).make_drawing(character))
        self._cache: dict[str, tuple[tuple[object, ...], Character]] = {}

    def get_mesh(self, character: RigBase) -> Character | None:
        """Returns the render mesh, with a default colour if it has no colours.

        Returns None if there is no surface.
        """
        if character.mesh is None or not len(character.mesh.faces):
            return None
        parts = (*(getattr(character, name) for name in character.drawn_by), get_theme()[1])
        cached = self._cache.get(character.id)
        if cached is None or any(a is not b for a, b in zip(cached[0], parts, strict=True)):
            cached = self._cache[character.id] = (parts, _add_default_colour(self._make_mesh(character)))
        return cached[1]


def _add_default_colour(character: Character) -> Character:
    if character.colours is not None:
        return character
    colour = np.array(choose_default_colour(character.id), np.uint8)
    return replace(character, colours=np.tile(colour, (len(character.vertices), 1)))
