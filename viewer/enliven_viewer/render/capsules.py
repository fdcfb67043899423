"""The performer as tapered capsules: for drawing, shadows, and cutaways of the mesh around them."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

import moderngl
import numpy as np

from enliven.arrays import Float32, Int32
from enliven.person import BONES, Body, Joint
from enliven_viewer.render.materials.paint import linear_from_srgb
from enliven_viewer.theme import PERFORMER_COLOURS

MAX_BONES = 64
"""Maximum number of capsules in the mesh shader. It must equal the number in shaders/mesh.frag."""
REVEAL_RADIUS = 0.04
"""Radius in metres around a bone within which the mesh is cut away, as in KinÊtre (section 4.3)."""

_JOINT_RADIUS = 0.026
"""Radius in metres at most joints. All radii are for a person of 1.75 m, and smaller than in reality."""
_WRIST_RADIUS = 0.019
"""Radius in metres at wrists and ankles, the thinnest places of a limb."""
_HAND_RADIUS = 0.022
"""Radius in metres at hands and feet."""
_TRUNK_RADIUS = 0.034
"""Radius in metres along the spine."""
_HEAD_RADIUS = 0.092
"""Radius of the head in metres."""
_JOINT_RADII = np.full(len(Joint), _JOINT_RADIUS)
_JOINT_RADII[[Joint.WRIST_LEFT, Joint.WRIST_RIGHT, Joint.ANKLE_LEFT, Joint.ANKLE_RIGHT]] = _WRIST_RADIUS
_JOINT_RADII[[Joint.HAND_LEFT, Joint.HAND_RIGHT, Joint.FOOT_LEFT, Joint.FOOT_RIGHT]] = _HAND_RADIUS
_JOINT_RADII[[Joint.HIP_CENTER, Joint.SPINE, Joint.SHOULDER_CENTER]] = _TRUNK_RADIUS
_SEGMENTS = 18
"""Number of faces around a capsule. Its outline looks round from any distance."""
_RINGS = 5
"""Number of vertex rings from the equator of a hemisphere to its pole."""
_SHADOW_SEGMENTS = 10
"""Number of faces around a shadow-casting capsule. The shadow's blur hides its corners."""
_SHADOW_RINGS = 3
"""Number of rings of a shadow-casting hemisphere. The shadow's blur hides its corners."""


def make_capsule_rows(
    bodies: tuple[Body, ...],
    opacity: float,
    limbs: Mapping[int, Mapping[int, tuple[float, float, float]]] = MappingProxyType({}),
) -> Float32:
    """Returns (N, 12) float32 rows of bones, joints and heads.

    A row has start xyz and radius, end xyz and radius, rgb and opacity.

    Args:
        limbs: by body id, the sRGB colours of bones by their outer joint. Other bones have the body's colour.
    """
    tints = linear_from_srgb(np.array(PERFORMER_COLOURS, float))
    rows = [_make_body_rows(body, tints[k % len(tints)], opacity) for k, body in enumerate(bodies)]
    for body, body_rows in zip(bodies, rows, strict=True):
        for joint, tint in limbs.get(body.id, {}).items():
            bone = [number for number, (_, end) in enumerate(BONES) if end == joint]
            body_rows[[*bone, len(BONES) + joint], 8:11] = linear_from_srgb(255.0 * np.array(tint))
    return np.concatenate(rows) if rows else np.zeros((0, 12), np.float32)


def _make_body_rows(body: Body, tint: Float32, opacity: float) -> Float32:
    joints, size = body.joints, float(np.clip(body.height / 1.75, 0.4, 1.6))
    opacities = opacity * (0.12 + 0.88 * np.clip(body.confidence, 0, 1))
    start, end = np.array(BONES).T
    count = len(BONES)
    rows = np.zeros((count + len(joints), 12))
    rows[:count, 0:3], rows[:count, 3] = joints[start], 0.72 * _JOINT_RADII[start]
    rows[:count, 4:7], rows[:count, 7] = joints[end], 0.72 * _JOINT_RADII[end]
    rows[:count, 11] = np.minimum(opacities[start], opacities[end])
    # Draw each joint as a ball, which is a capsule of length zero.
    rows[count:, 0:3] = rows[count:, 4:7] = joints
    rows[count:, 3] = rows[count:, 7] = 1.12 * _JOINT_RADII
    rows[count + Joint.HEAD, [3, 7]] = _HEAD_RADIUS
    rows[count:, 11] = opacities
    rows[:, [3, 7]] *= size
    rows[:, 8:11] = tint
    return rows.astype(np.float32)


def make_bone_block(bodies: tuple[Body, ...], strength: float) -> tuple[Float32, int]:
    """Returns the uniform block ``Bones`` of shaders/mesh.frag, (3, 64, 4) float32, and the number of bones
    in it.
    """
    block = np.zeros((3, MAX_BONES, 4), np.float32)
    rows = []
    for body in bodies:
        radius = REVEAL_RADIUS * float(np.clip(body.height / 1.75, 0.4, 1.6))
        for start, end in BONES:
            bone_strength = strength * float(min(body.confidence[start], body.confidence[end]))
            rows.append((*body.joints[start], radius, *body.joints[end], radius, bone_strength))
    bone_rows = np.array(rows[:MAX_BONES], np.float32).reshape(-1, 9)
    block[0, : len(bone_rows)] = bone_rows[:, 0:4]
    block[1, : len(bone_rows)] = bone_rows[:, 4:8]
    block[2, : len(bone_rows), 0] = bone_rows[:, 8]
    return block, len(bone_rows)


class CapsulePass:
    """Instanced capsules on the GPU. Each consists of a tube and two balls.

    Args:
        program: program of ``capsule.vert`` or ``tube.vert``.
        open_limbs: True to draw tubes without caps, because thicker balls cover all their ends.
        casting: True if the capsules only cast shadows.
    """

    def __init__(
        self,
        ctx: moderngl.Context,
        program: moderngl.Program,
        *,
        open_limbs: bool = False,
        casting: bool = False,
    ) -> None:
        segments, rings = (_SHADOW_SEGMENTS, _SHADOW_RINGS) if casting else (_SEGMENTS, _RINGS)
        self._counts = [0, 0]
        self._instances = [ctx.buffer(reserve=12 * 4 * 64, dynamic=True) for _ in self._counts]
        templates = (
            make_capsule_template(segments, 1 if open_limbs else rings),
            make_capsule_template(segments, rings, ball=True),
        )
        self._arrays = [
            ctx.vertex_array(
                program,
                [
                    (ctx.buffer(vertices.tobytes()), "3f 1f", "in_direction", "in_end"),
                    (instances, "4f 4f 4f/i", "in_from", "in_to", "in_tint"),
                ],
                index_buffer=ctx.buffer(faces.tobytes()),
                index_element_size=4,
            )
            for instances, (vertices, faces) in zip(self._instances, templates, strict=True)
        ]

    def load(self, rows: Float32) -> None:
        """Uploads the (N, 12) rows of :func:`make_capsule_rows`."""
        ball = (rows[:, 0:3] == rows[:, 4:7]).all(1)
        for number, rows_of_kind in enumerate((rows[~ball], rows[ball])):
            self._counts[number] = len(rows_of_kind)
            if len(rows_of_kind):
                self._instances[number].orphan(rows_of_kind.nbytes)
                self._instances[number].write(np.ascontiguousarray(rows_of_kind))

    def render(self) -> None:
        """Draws the loaded rows."""
        for array, count in zip(self._arrays, self._counts, strict=True):
            if count:
                array.render(moderngl.TRIANGLES, instances=count)


def make_capsule_template(
    segments: int = _SEGMENTS, rings: int = _RINGS, *, ball: bool = False
) -> tuple[Float32, Int32]:
    """Returns a capsule along +Y as (N, 4) vertices and (F, 3) faces. A vertex is a unit direction and the
    index of its end, 0 or 1.

    Args:
        segments: number of faces around.
        rings: number of vertex rings from the equator to a pole; 1 leaves both ends open.
        ball: True to omit the tube between the hemispheres.
    """
    upper = np.linspace(0, np.pi / 2, rings)
    latitude = np.concatenate([-upper[::-1], upper[1:] if ball else upper])
    end = np.repeat([0.0, 1.0], [rings, rings - 1 if ball else rings])
    around = np.linspace(0, 2 * np.pi, segments, endpoint=False)
    ring = np.stack([np.cos(around), np.zeros(segments), np.sin(around)], -1)
    direction = np.cos(latitude)[:, None, None] * ring
    direction[..., 1] = np.sin(latitude)[:, None]
    vertices = np.concatenate([direction, np.broadcast_to(end[:, None, None], (*direction.shape[:2], 1))], -1)
    row, column = np.meshgrid(np.arange(len(latitude) - 1), np.arange(segments), indexing="ij")
    a, b = row * segments + column, row * segments + (column + 1) % segments
    c, d = a + segments, b + segments
    faces = np.stack([a, c, b, b, c, d], -1)
    if rings > 1:
        # All vertices at a pole coincide, so half of the faces around it are degenerate. Drop these faces.
        faces = np.concatenate([faces[0, :, 3:], faces[1:-1].reshape(-1, 3), faces[-1, :, :3]])
    return vertices.reshape(-1, 4).astype(np.float32), faces.reshape(-1, 3).astype(np.int32)
