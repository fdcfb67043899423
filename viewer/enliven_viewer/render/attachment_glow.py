"""Computes the glow on the parts of a mesh that performers control. It is visible from across a room."""

from __future__ import annotations

from collections.abc import Sequence

import moderngl
import numpy as np

from enliven.arrays import Float32
from enliven.document import Character, SkinWeights
from enliven_viewer.render.gl.program import TEXTURE_UNITS
from enliven_viewer.render.overlay.marks import find_cue_tints
from enliven_viewer.render.scene import SceneCharacter

_GLOW_SPREAD_EDGES = 3
"""Distance in graph edges over which the glow spreads beyond attached nodes: about 10 cm."""
_GLOW_FRACTION_PER_EDGE = 0.72
"""Factor on the glow per graph edge."""
_PREVIEW_GLOW_FRACTION = 0.4
"""Fraction of the glow on previewed parts, which are not attached yet."""
_GLOW_RADIUS = 0.16
"""Distance from a control point at which its glow has dropped to 1/e, as a fraction of the mesh's size."""
TRANSFORMS_PER_ROW = 256
"""Number of transforms in a row of the texture. It must equal the number in shaders/mesh.vert."""


def compute_node_glow(actor: SceneCharacter, strength: float, bodies: Sequence[int] = ()) -> Float32 | None:
    """Returns (J, 3) linear RGB of the glow on each transform of an actor, or None if nothing is attached.

    Args:
        bodies: ids of the visible performers, in the order of their colours.
    """
    cues, character = actor.cues, actor.character
    count = len(character.pivots)
    if cues is None or strength <= 0 or not (is_valid := (cues.nodes >= 0) & (cues.nodes < count)).any():
        return None
    level = (
        strength
        * np.clip(cues.strengths[is_valid], 0, 1)
        * np.where(cues.attached_mask[is_valid], 1.0, _PREVIEW_GLOW_FRACTION)
    )
    light = np.zeros((count, 3), np.float32)
    np.maximum.at(
        light, cues.nodes[is_valid], (level[:, None] * find_cue_tints(cues, bodies)[is_valid]).astype("f4")
    )
    edges = character.edges if character.kind == "graph" else np.zeros((0, 2), np.int32)
    directed_edges = np.concatenate([edges, edges[:, ::-1]])
    for _ in range(_GLOW_SPREAD_EDGES):
        np.maximum.at(light, directed_edges[:, 1], _GLOW_FRACTION_PER_EDGE * light[directed_edges[:, 0]])
    return light


def compute_point_weights(character: Character) -> SkinWeights:
    """Returns the four control points with the strongest glow at each vertex, with their weights.

    The weights decrease with the distance at rest.
    """
    vertices, points = character.vertices, character.pivots[1:]
    distances = np.linalg.norm(vertices[:, None] - points[None], axis=2)
    nearest = np.argsort(distances, axis=1)[:, :4]
    size = float(np.linalg.norm(np.ptp(vertices, axis=0)))
    fraction = np.exp(-((np.take_along_axis(distances, nearest, 1) / (_GLOW_RADIUS * max(size, 1e-6))) ** 2))
    padding = ((0, 0), (0, 4 - nearest.shape[1]))
    return SkinWeights(np.pad(nearest + 1, padding).astype("u2"), np.pad(fraction, padding).astype("f4"))


class AttachmentGlow:
    """The glow on the transforms of one character, as a texture.

    Args:
        count: number of transforms.
    """

    def __init__(self, ctx: moderngl.Context, count: int) -> None:
        rows = -(-count // TRANSFORMS_PER_ROW)
        self._staged = np.zeros((rows * TRANSFORMS_PER_ROW, 4), np.float32)
        self._texture = ctx.texture((TRANSFORMS_PER_ROW, rows), 4, dtype="f4")
        self._texture.filter = moderngl.NEAREST, moderngl.NEAREST
        self._written: Float32 | None = None

    def use(self, light: Float32) -> None:
        """Binds the glow (J, 3). It is uploaded only after a change."""
        if self._written is None or not np.array_equal(light, self._written):
            self._staged[: len(light), :3] = light
            self._texture.write(self._staged)
            self._written = light
        self._texture.use(TEXTURE_UNITS["held"])

    def release(self) -> None:
        """Frees the GPU memory."""
        self._texture.release()
