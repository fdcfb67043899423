"""Marks on the floor of the kiosk's picture: the spot, its progress ring, and the mark of the next visitor.
They are meshes, so that feet and characters occlude them and perspective applies to them.
"""

from __future__ import annotations

import json
import math

import numpy as np

from enliven.arrays import Float32, Int32
from enliven.document import Character, SkinWeights
from enliven.kiosk.visitors import Place
from enliven.meshes import MeshMaterials
from enliven_viewer.render.materials.paint import linear_from_srgb
from enliven_viewer.render.scene import SceneCharacter

_SECTIONS = 96
"""Number of quadrilaterals around a ring. With 96, it looks round on any screen."""
_HEIGHT_M = 0.004
"""Height of a mark above the floor in metres, which prevents z-fighting with the floor."""
_FILL_HEIGHT_M = 0.009
"""Height of the progress ring's filled part above the floor in metres, so that it covers the border."""

Rgb = tuple[int, int, int]


class FloorMark:
    """A ring or disc on the floor, or a sector of it.

    Args:
        name: its name, unique in a scene.
        colour: sRGB.
        height: metres above the floor.
    """

    def __init__(self, name: str, colour: Rgb, height: float = _HEIGHT_M) -> None:
        self._height = height
        around = np.linspace(0.0, 1.0, _SECTIONS + 1)
        self._around = np.stack([around, around], 1).ravel()
        a = 2 * np.arange(_SECTIONS, dtype=np.int32)
        faces = np.concatenate([np.stack([a, a + 1, a + 2], 1), np.stack([a + 2, a + 1, a + 3], 1)])
        self._character = _make_character(name, self._ring_vertices((0.0, 0.0), 0.4, 0.5, 1.0), faces, colour)

    def make_mark(self, place: Place, inner: float, outer: float, fraction: float = 1.0) -> SceneCharacter:
        """Returns the mark around a point (x, z) of the floor in metres.

        Args:
            inner, outer: radii in metres.
            fraction: fraction of the ring that is drawn, 0..1. It begins at the far side, and grows to the
                right in the mirrored picture.
        """
        vertices = self._ring_vertices(place, inner, outer, min(max(fraction, 1e-3), 1.0))
        return SceneCharacter(self._character, self._character.rest_pose(), None, vertices)

    def _ring_vertices(self, place: Place, inner: float, outer: float, fraction: float) -> Float32:
        angle = 2 * math.pi * fraction * self._around
        radius = np.tile([inner, outer], _SECTIONS + 1)
        x, z = place[0] - radius * np.sin(angle), place[1] - radius * np.cos(angle)
        return np.stack([x, np.full(len(x), self._height), z], 1).astype(np.float32)


class SpotMark:
    """The spot of one performer: its border and its progress ring.

    Args:
        number: number of the spot, part of the marks' names.
        border, filling: sRGB of the border and of the progress ring.
    """

    def __init__(self, number: int, border: Rgb, filling: Rgb) -> None:
        self._border = FloorMark(f"spot border {number}", border)
        self._track = FloorMark(f"spot track {number}", (58, 64, 78))
        self._filling = FloorMark(f"spot ring {number}", filling, _FILL_HEIGHT_M)

    def draw(self, place: Place, radius: float, ring: float, pulse: float) -> list[SceneCharacter]:
        """Returns the marks.

        Args:
            radius: metres.
            ring: filled fraction of the progress ring, 0..1.
            pulse: phase of the pulsation, -1..1, which moves the border in and out.
        """
        outer = radius * (1.0 + 0.05 * pulse)
        marks = [self._border.make_mark(place, 0.93 * outer, outer)]
        if ring > 0.0:
            marks.append(self._track.make_mark(place, 0.72 * radius, 0.9 * radius))
            marks.append(self._filling.make_mark(place, 0.7 * radius, 0.92 * radius, ring))
        return marks


def _make_character(name: str, vertices: Float32, faces: Int32, colour: Rgb) -> Character:
    """Returns an unlit mesh of one colour as a character."""
    linear = linear_from_srgb(np.array(colour, float)).tolist()
    definition = {
        "pbrMetallicRoughness": {"baseColorFactor": [*linear, 1.0]},
        "doubleSided": True,
        "extensions": {"KHR_materials_unlit": {}},
    }
    materials = MeshMaterials(
        (json.dumps(definition),),
        (),
        np.zeros(len(faces), np.int32),
        np.zeros((len(faces), 3, 1, 2), np.float32),
    )
    weights = np.zeros((len(vertices), 4), np.float32)
    weights[:, 0] = 1.0
    skin = SkinWeights(np.zeros((len(vertices), 4), np.uint16), weights)
    pivots, edges = np.zeros((1, 3), np.float32), np.zeros((0, 2), np.int32)
    return Character(name, vertices, faces, skin, pivots, edges, "bones", materials=materials)
