"""Picking: finds joints, bones and surfaces under the pointer, and bones that a stroke crosses. Pixels are
measured from the viewport's top left corner, x to the right and y down.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from enliven.arrays import Float, Float32
from enliven.matching.views import ScreenView as MatchView
from enliven_viewer.render.camera import CameraView
from enliven_viewer.studio.viewport.overlay import Point
from enliven_viewer.studio.viewport.ray import NEAREST, find_first_hit
from enliven_viewer.studio.viewport.stage_character import StageCharacter

_TUBE_DEPTH_BIAS = 0.4
"""Depth bias of bones and trails as a fraction of the camera distance. Up to this depth below a surface they
are visible.
"""
_MIN_TUBE_DISTANCE_M = 0.05
"""For smaller camera distances than this, in metres, the depth bias does not shrink further."""


@dataclass(frozen=True)
class Lens:
    """A camera view, and the size (width, height) in pixels of the viewport that shows it."""

    view: CameraView
    size: tuple[float, float]

    def project(self, points: Float) -> tuple[Float, Float]:
        """Returns pixels (N, 2) and depths (N,) in metres of points (N, 3).

        Pixels of points behind the camera are not finite.
        """
        clip = np.c_[points, np.ones(len(points))] @ self.view.clip_from_world.T
        depth = np.where(clip[:, 3] > NEAREST, clip[:, 3], np.nan)
        ndc = clip[:, :2] / depth[:, None]
        return np.asarray((ndc * [1.0, -1.0] + 1.0) / 2.0 * self.size), clip[:, 3]

    def ray(self, pixel: Point) -> Float:
        """Returns the (3,) unit direction from the camera through a pixel."""
        ndc = np.array([2 * pixel[0] / self.size[0] - 1, 1 - 2 * pixel[1] / self.size[1]])
        projection = self.view.clip_from_camera
        seen = np.array([ndc[0] / projection[0, 0], ndc[1] / projection[1, 1], -1.0])
        direction = self.view.camera_from_world[:3, :3].T @ seen
        return np.asarray(direction / np.linalg.norm(direction))

    def intersect_plane(self, pixel: Point, through: Float) -> Float:
        """Returns the intersection (3,) in metres of a pixel's ray with the plane through a point, parallel
        to the image.
        """
        forward, ray = -self.view.camera_from_world[2, :3], self.ray(pixel)
        return np.asarray(self.view.eye + ray * ((through - self.view.eye) @ forward) / (ray @ forward))

    def project_visible(self, points: Float) -> list[Point]:
        """Returns the pixels of those points (N, 3) that are in front of the camera."""
        if not len(points):
            return []
        return [(float(x), float(y)) for x, y in self.project(points)[0] if np.isfinite(x) and np.isfinite(y)]

    def pixel_sizes(self, points: Float) -> Float:
        """Returns the size (N,) of a pixel in metres at each of the points (N, 3)."""
        depth = np.maximum((points - self.view.eye) @ self.forward, 0.05)
        return np.asarray(2 * depth / (self.view.clip_from_camera[1, 1] * self.size[1]), np.float64)

    @property
    def forward(self) -> Float:
        """Returns the (3,) unit viewing direction."""
        return np.asarray(-self.view.camera_from_world[2, :3])

    def tube_bias(self, positions: Float | Float32) -> float:
        """Returns the depth in metres below a surface up to which tubes are visible.

        Args:
            positions: (N, 3) metres on the tubes.
        """
        near = float(((positions - self.view.eye) @ self.forward).min())
        return _TUBE_DEPTH_BIAS * max(near, _MIN_TUBE_DISTANCE_M)

    @property
    def up(self) -> Float:
        """Returns the (3,) unit vector that points up in the image."""
        return np.asarray(self.view.camera_from_world[1, :3])


def make_match_view(lens: Lens) -> MatchView:
    """Returns a lens as a view for the matcher."""
    return MatchView(lens.forward, lens.up, lens.view.eye)


@dataclass(frozen=True)
class Hit:
    """The part of a character under the pointer.

    Attributes:
        character: id of the character.
        handle: the joint or control point, or the joint at the end of a bone; -1 on the surface.
        along: position on the bone, 0 at its start and 1 at the handle.
        pixels: distance from the pointer in pixels.
        depth: depth in front of the camera in metres.
        face: index of the mesh's face if the hit is on the surface; otherwise -1.
    """

    character: str
    handle: int = -1
    along: float = 1.0
    pixels: float = 0.0
    depth: float = 0.0
    face: int = -1


def find_joint_at(stage: Iterable[StageCharacter], lens: Lens, pixel: Point, reach: float) -> Hit | None:
    """Returns the handle nearest to a pixel within ``reach`` pixels.

    If two handles are equally near to the pixel, returns the handle nearer to the camera.
    """
    hits = []
    for character in stage:
        pixels, depth = lens.project(character.handles)
        distance = np.linalg.norm(pixels - pixel, axis=1)
        for handle in np.flatnonzero(distance <= reach):
            hits.append(Hit(character.id, int(handle), 1.0, float(distance[handle]), float(depth[handle])))
    return min(hits, key=lambda hit: (round(hit.pixels), hit.depth), default=None)


def find_bone_at(stage: Iterable[StageCharacter], lens: Lens, pixel: Point, reach: float) -> Hit | None:
    """Returns the bone nearest to a pixel within ``reach`` pixels, with the position on it."""
    hits = []
    for character in stage:
        pixels, depth = lens.project(character.handles)
        for parent, handle in character.bones:
            fraction, distance = _find_nearest_parameter(pixels[parent], pixels[handle], np.array(pixel))
            if distance <= reach:
                along = _correct_perspective(fraction, depth[parent], depth[handle])
                deep = float(depth[parent] + along * (depth[handle] - depth[parent]))
                hits.append(Hit(character.id, handle, along, distance, deep))
    return min(hits, key=lambda hit: (round(hit.pixels), hit.depth), default=None)


def find_surface_at(stage: Iterable[StageCharacter], lens: Lens, pixel: Point) -> Hit | None:
    """Returns the first surface that a pixel's ray hits, and the face."""
    ray, eye, hits = lens.ray(pixel), lens.view.eye, list[Hit]()
    for character in stage:
        if character.character.mesh is not None:
            face, distance = find_first_hit(character.vertices, character.character.mesh.faces, eye, ray)
            if face >= 0:
                hits.append(Hit(character.id, depth=distance, face=face))
    return min(hits, key=lambda hit: hit.depth, default=None)


def find_crossings(stage: Iterable[StageCharacter], lens: Lens, stroke: Float) -> list[Hit]:
    """Returns the bones that a stroke (P, 2) in pixels crosses, with the position of the crossing. Each bone
    is listed once.
    """
    hits: list[Hit] = []
    for character in stage:
        pixels, depth = lens.project(character.handles)
        for parent, handle in character.bones:
            for first, last in itertools.pairwise(stroke):
                fraction = _find_crossing(pixels[parent], pixels[handle], first, last)
                if fraction is not None:
                    along = _correct_perspective(fraction, depth[parent], depth[handle])
                    deep = float(depth[parent] + along * (depth[handle] - depth[parent]))
                    hits.append(Hit(character.id, handle, along, 0.0, deep))
                    break
    return hits


def _find_nearest_parameter(a: Float, b: Float, p: Float) -> tuple[float, float]:
    """Returns (parameter, distance) of the point on the segment a-b that is nearest to p. All points are
    (2,). NaN gives an infinite distance.
    """
    segment = b - a
    length = float(segment @ segment)
    if not np.isfinite(length):
        return 0.0, np.inf
    fraction = float(np.clip((p - a) @ segment / length, 0.0, 1.0)) if length > 1e-12 else 0.0
    return fraction, float(np.linalg.norm(a + fraction * segment - p))


def _correct_perspective(fraction: float, near: float, far: float) -> float:
    """Returns the 3D parameter along a segment for the 2D parameter ``fraction`` (perspective correction)."""
    return float(fraction * near / (fraction * near + (1.0 - fraction) * far))


def _find_crossing(a: Float, b: Float, c: Float, d: Float) -> float | None:
    """Returns the parameter on the segment a-b at which it crosses the segment c-d, or None if they do not
    cross. All points are (2,).
    """
    first, second = b - a, d - c
    determinant = first[0] * second[1] - first[1] * second[0]
    if not np.isfinite(determinant) or abs(determinant) < 1e-12:
        return None
    offset = c - a
    fraction = (offset[0] * second[1] - offset[1] * second[0]) / determinant
    other = (offset[0] * first[1] - offset[1] * first[0]) / determinant
    return float(fraction) if 0.0 <= fraction <= 1.0 and 0.0 <= other <= 1.0 else None
