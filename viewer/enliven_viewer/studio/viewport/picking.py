"""What is under the pointer: joints, places on bones, surfaces, and bones that a stroke crosses.

Pixels are counted from the viewport's top left, x to the right and y down.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from enliven.arrays import Float, Int32
from enliven_viewer.render import CameraView
from enliven_viewer.studio.viewport.pose_at_time import PosedShape

_NEAREST = 1e-3
"""Metres before the eye: what is nearer, or behind it, cannot be picked."""


@dataclass(frozen=True)
class Lens:
    """A view and the size in pixels (width, height) that it is shown at."""

    view: CameraView
    size: tuple[float, float]

    def project(self, points: Float) -> tuple[Float, Float]:
        """(N, 2) pixels and (N,) metres before the eye of (N, 3) points; not finite where behind it."""
        clip = np.c_[points, np.ones(len(points))] @ self.view.clip_from_world.T
        depth = np.where(clip[:, 3] > _NEAREST, clip[:, 3], np.nan)
        ndc = clip[:, :2] / depth[:, None]
        return np.asarray((ndc * [1.0, -1.0] + 1.0) / 2.0 * self.size), clip[:, 3]

    def ray(self, at: tuple[float, float]) -> Float:
        """(3,) unit direction from the eye through a pixel."""
        ndc = np.array([2 * at[0] / self.size[0] - 1, 1 - 2 * at[1] / self.size[1]])
        projection = self.view.clip_from_camera
        seen = np.array([ndc[0] / projection[0, 0], ndc[1] / projection[1, 1], -1.0])
        way = self.view.camera_from_world[:3, :3].T @ seen
        return np.asarray(way / np.linalg.norm(way))

    def on_plane(self, at: tuple[float, float], through: Float) -> Float:
        """(3,) where the ray of a pixel meets the plane through a point, parallel to the picture."""
        forward, way = -self.view.camera_from_world[2, :3], self.ray(at)
        return np.asarray(self.view.eye + way * ((through - self.view.eye) @ forward) / (way @ forward))

    @property
    def forward(self) -> Float:
        """(3,) unit direction that the camera looks along."""
        return np.asarray(-self.view.camera_from_world[2, :3])

    @property
    def up(self) -> Float:
        """(3,) unit direction up in the picture."""
        return np.asarray(self.view.camera_from_world[1, :3])


@dataclass(frozen=True)
class Hit:
    """Something under the pointer.

    Attributes:
        shape: the id of a shape.
        joint: the joint, or the bone that ends there.
        along: where on the bone, 0 at its parent and 1 at its joint.
        pixels: how far the pointer is from it.
        depth: metres before the eye.
    """

    shape: str
    joint: int
    along: float
    pixels: float
    depth: float


def joint_at(
    posed_shapes: Iterable[PosedShape], lens: Lens, at: tuple[float, float], reach: float
) -> Hit | None:
    """The joint nearest to a pixel within ``reach`` pixels; of two as near, the one before the other."""
    found = []
    for posed in posed_shapes:
        pixels, depth = lens.project(posed.joints)
        away = np.linalg.norm(pixels - at, axis=1)
        for joint in np.flatnonzero(away <= reach):
            found.append(Hit(posed.shape.id, int(joint), 1.0, float(away[joint]), float(depth[joint])))
    return min(found, key=lambda hit: (round(hit.pixels), hit.depth), default=None)


def bone_at(
    posed_shapes: Iterable[PosedShape], lens: Lens, at: tuple[float, float], reach: float
) -> Hit | None:
    """The bone nearest to a pixel within ``reach`` pixels, and the place on it."""
    found = []
    for posed in posed_shapes:
        pixels, depth = lens.project(posed.joints)
        for joint in range(1, len(posed.joints)):
            parent = int(posed.shape.skeleton.parents[joint])
            share, away = _nearest_on(pixels[parent], pixels[joint], np.array(at))
            if away <= reach:
                along = _in_space(share, depth[parent], depth[joint])
                deep = float(depth[parent] + along * (depth[joint] - depth[parent]))
                found.append(Hit(posed.shape.id, joint, along, away, deep))
    return min(found, key=lambda hit: (round(hit.pixels), hit.depth), default=None)


def surface_at(posed_shapes: Iterable[PosedShape], lens: Lens, at: tuple[float, float]) -> Hit | None:
    """The mesh that the ray of a pixel meets first; ``joint`` is the bone that its place follows most."""
    way, eye = lens.ray(at), lens.view.eye
    best: Hit | None = None
    for posed in posed_shapes:
        mesh, skin = posed.shape.mesh, posed.shape.skin
        if mesh is None or skin is None:
            continue
        face, distance = first_face(posed.surface(), mesh.faces, eye, way)
        if face >= 0 and (best is None or distance < best.depth):
            vertex = mesh.faces[face, 0]
            bone = int(skin.indices[vertex, int(skin.weights[vertex].argmax())])
            best = Hit(posed.shape.id, bone, 0.5, 0.0, distance)
    return best


def crossings(posed_shapes: Iterable[PosedShape], lens: Lens, stroke: Float) -> list[Hit]:
    """The bones that a stroke (P, 2) of pixels crosses, in its order, each once and where."""
    found: list[Hit] = []
    for posed in posed_shapes:
        pixels, depth = lens.project(posed.joints)
        for joint in range(1, len(posed.joints)):
            parent = int(posed.shape.skeleton.parents[joint])
            for first, last in itertools.pairwise(stroke):
                share = _crossing(pixels[parent], pixels[joint], first, last)
                if share is not None:
                    along = _in_space(share, depth[parent], depth[joint])
                    deep = float(depth[parent] + along * (depth[joint] - depth[parent]))
                    found.append(Hit(posed.shape.id, joint, along, 0.0, deep))
                    break
    return found


def _nearest_on(a: Float, b: Float, p: Float) -> tuple[float, float]:
    """The share of the way from a to b nearest to p, all (2,), and how far that is; nan stays far."""
    way = b - a
    length = float(way @ way)
    if not np.isfinite(length):
        return 0.0, np.inf
    share = float(np.clip((p - a) @ way / length, 0.0, 1.0)) if length > 1e-12 else 0.0
    return share, float(np.linalg.norm(a + share * way - p))


def _in_space(share: float, near: float, far: float) -> float:
    """The share of the way in space that projects to ``share`` of the way in the picture."""
    return float(share * near / (share * near + (1.0 - share) * far))


def _crossing(a: Float, b: Float, c: Float, d: Float) -> float | None:
    """The share of the way from a to b where it crosses the way from c to d, all (2,); None where not."""
    first, second = b - a, d - c
    determinant = first[0] * second[1] - first[1] * second[0]
    if not np.isfinite(determinant) or abs(determinant) < 1e-12:
        return None
    way = c - a
    share = (way[0] * second[1] - way[1] * second[0]) / determinant
    other = (way[0] * first[1] - way[1] * first[0]) / determinant
    return float(share) if 0.0 <= share <= 1.0 and 0.0 <= other <= 1.0 else None


def first_face(vertices: Float, faces: Int32, eye: Float, way: Float) -> tuple[int, float]:
    """The nearest face on a ray and how far it is (Moeller and Trumbore 1997); -1 for none."""
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    side, other = b - a, c - a
    across = np.cross(way, other)
    determinant = np.einsum("fi,fi->f", side, across)
    safe = np.where(np.abs(determinant) > 1e-18, determinant, np.nan)
    arm = eye - a
    u = np.einsum("fi,fi->f", arm, across) / safe
    turned = np.cross(arm, side)
    v = turned @ way / safe
    distance = np.einsum("fi,fi->f", other, turned) / safe
    with np.errstate(invalid="ignore"):
        met = (u >= 0) & (v >= 0) & (u + v <= 1) & (distance > _NEAREST)
    if not met.any():
        return -1, np.inf
    face = int(np.where(met, distance, np.inf).argmin())
    return face, float(distance[face])
