"""What stands on the floor is cut out of a scan: the floor found, holes closed, the thing put upright."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from enliven import rotation
from enliven.arrays import Bool, Float
from enliven.errors import InputError
from enliven.meshes import Mesh, shells, submesh
from enliven.scanning.rims import close_holes, lowest_rims
from enliven.scanning.settings import CutOutSettings

_GUESSES = 100
"""Faces that are tried as the floor: one of ten that is of the floor is enough."""
_LOOKED_AT = 6000
"""Faces, by chance, that a plane is compared with: they tell its area to some percent."""
_LEVEL = 0.82
"""Cosine, 35 degrees, between a face's normal and the way up below which it is no part of a floor."""
_FLAT = 0.97
"""Cosine, 14 degrees, between a floor's normal and those of its faces at least: noise tilts them."""
_RIVAL = 0.5
"""Share of the largest plane's area from which a lower one is the floor, and that one a table."""
_ASIDE = 0.05
"""Share of the meant thing's surface about the focus below which other things there do not count."""
_AGAIN = 3
"""Times that a plane is fitted to the faces in it."""


@dataclass(frozen=True)
class Ground:
    """The plane on which things stand: normal . x = offset, world.

    Attributes:
        normal: (3,) unit, up.
        offset: metres.
        area: square metres of it that were seen.
    """

    normal: Float
    offset: float
    area: float

    def heights(self, points: Float) -> Float:
        """Returns (N,) metres of (N, 3) points above it."""
        return np.asarray(points @ self.normal - self.offset)


def find_ground(mesh: Mesh, up: Float | None = None, settings: CutOutSettings | None = None) -> Ground:
    """Returns the lowest of the large level planes of a scan.

    Args:
        up: (3,) about up, in the scan's world; +Y where it is not given. It may be 35 degrees off.

    Raises:
        InputError: where nothing level was scanned.
    """
    s, up = settings or CutOutSettings(), np.array([0.0, 1.0, 0.0]) if up is None else up
    vectors = mesh.face_vectors()
    areas = np.linalg.norm(vectors, axis=1) / 2
    normals = vectors / np.maximum(2 * areas, 1e-30)[:, None]
    middles = mesh.vertices[mesh.faces].mean(1) if len(mesh.faces) else np.zeros((0, 3))
    level = np.flatnonzero(normals @ up > _LEVEL)
    count = len(level)
    if not count:
        what = "no floor and no table top was scanned"
        raise InputError(what, where="scan", mend="Scan a part of the floor round the thing, too.")
    level = np.random.default_rng(0).permutation(level)[:_LOOKED_AT]
    normals, middles, areas = normals[level], middles[level], areas[level] * count / len(level)
    planes = [
        _fitted(normals[k], float(normals[k] @ middles[k]), normals, middles, areas, s)
        for k in range(min(_GUESSES, len(level)))
    ]
    most = max(plane.area for plane in planes)
    large = [plane for plane in planes if plane.area > _RIVAL * most]
    place = np.average(middles, axis=0, weights=areas)
    return min(large, key=lambda plane: float(plane.offset - place @ plane.normal) / float(plane.normal @ up))


def _fitted(
    normal: Float, offset: float, normals: Float, middles: Float, areas: Float, s: CutOutSettings
) -> Ground:
    """Returns the plane through the faces that lie in a guessed one."""
    inside = _lying(normal, offset, normals, middles, s)
    for _ in range(_AGAIN):
        weight = areas[inside]
        if weight.sum() <= 0 or inside.sum() < 3:
            break
        middle = np.average(middles[inside], axis=0, weights=weight)
        spread = (middles[inside] - middle) * np.sqrt(weight)[:, None]
        fitted = np.linalg.svd(spread.T @ spread)[0][:, 2]
        normal = fitted if fitted @ normal > 0 else -fitted
        offset = float(normal @ middle)
        inside = _lying(normal, offset, normals, middles, s)
    return Ground(normal, offset, float(areas[inside].sum()))


def _lying(normal: Float, offset: float, normals: Float, middles: Float, s: CutOutSettings) -> Bool:
    """Returns (F,) which faces lie in a plane."""
    near = np.abs(middles @ normal - offset) < s.thickness
    return np.asarray(near & (normals @ normal > _FLAT))


def focus_of(poses: list[Float]) -> Float:
    """Returns the (3,) point to which the optical axes of cameras (4, 4) come nearest: what was looked at."""
    matrix, right = 1e-6 * np.eye(3), np.zeros(3)
    for pose in poses:
        axis = pose[:3, 2]
        across = np.eye(3) - np.outer(axis, axis)
        matrix += across
        right += across @ pose[:3, 3]
    # Where all look the same way, that is a metre before them.
    ahead = np.mean([pose[:3, 3] + pose[:3, 2] for pose in poses], axis=0)
    return np.asarray(np.linalg.solve(matrix, right + 1e-6 * ahead), np.float64)


def cut_out(mesh: Mesh, ground: Ground, focus: Float, settings: CutOutSettings | None = None) -> Mesh:
    """Returns what stands on the ground about ``focus`` (3,), upright, on y = 0, its box centred on x and z.

    Of several things the settings choose one. It is closed where it stood; holes with short rims are closed,
    and larger ones stay open.

    Raises:
        InputError: where nothing stands there, or not so many things.
    """
    s = settings or CutOutSettings()
    parts = parts_about(mesh, ground, focus, s)
    if not parts:
        what = "nothing that stands on the floor was scanned"
        raise InputError(
            what, where="scan", mend="Carry the camera round the thing, and look at it all the time."
        )
    if s.number > len(parts):
        what = f"there is no thing number {s.number} where the camera looked; {len(parts)} stand there"
        raise InputError(what, where="scan", mend="Choose one of them, or look at it while you scan.")
    thing = parts[s.number - 1]
    vertices = levelled(thing, ground).vertices
    # What the cut took off its feet is given back to them.
    feet = vertices[:, 1] < s.clearance + 1e-9
    vertices[feet, 1] = 0.0
    feet |= lowest_rims(replace(thing, vertices=vertices), s.drawn)
    vertices[feet, 1] = 0.0
    return close_holes(replace(thing, vertices=vertices), feet, s)


def whole_part(mesh: Mesh, ground: Ground, settings: CutOutSettings | None = None) -> Mesh:
    """Returns the largest connected part of an object that was seen from below, too, upright, on y = 0.

    Holes with short rims are closed.
    """
    part = levelled(largest(mesh), ground)
    part.vertices[:, 1] -= part.vertices[:, 1].min()
    return close_holes(part, np.zeros(len(part.vertices), bool), settings or CutOutSettings())


def parts_about(
    mesh: Mesh, ground: Ground, focus: Float, settings: CutOutSettings | None = None
) -> list[Mesh]:
    """Returns the connected parts that stand on the ground about a point (3,), the one that is meant first.

    That is the one with the most surface near the point; small ones, and those far away, are left out.
    """
    s = settings or CutOutSettings()
    above = above_plane(mesh, ground.normal, ground.offset + s.clearance)
    if not len(above.faces):
        return []
    label = np.asarray(shells(above.faces, len(above.vertices)))[above.faces[:, 0]]
    middles = above.vertices[above.faces].mean(1)
    near = np.exp(-np.square(middles - focus).sum(1) / s.about**2)
    areas = np.linalg.norm(above.face_vectors(), axis=1) / 2
    whole, worth = np.bincount(label, areas), np.bincount(label, areas * near)
    large = (whole >= s.least_area) & (worth >= _ASIDE * worth.max())
    return [submesh(above, label == n) for n in np.argsort(-worth, kind="stable") if large[n]]


def largest(mesh: Mesh) -> Mesh:
    """Returns the connected part of a mesh with the most surface."""
    if not len(mesh.faces):
        return mesh
    label = np.asarray(shells(mesh.faces, len(mesh.vertices)))[mesh.faces[:, 0]]
    return submesh(mesh, label == np.bincount(label, np.linalg.norm(mesh.face_vectors(), axis=1)).argmax())


def largest_part(mesh: Mesh) -> Mesh:
    """Returns the connected part with the most surface, standing on y = 0, its box centred on x and z."""
    part = largest(mesh)
    up = np.array([0.0, 1.0, 0.0])
    return levelled(part, Ground(up, float(part.vertices[:, 1].min()), 0.0))


def levelled(mesh: Mesh, ground: Ground) -> Mesh:
    """Returns the mesh turned upright and moved so that the ground is y = 0, its box centred on x and z."""
    turn = rotation.to_matrix(rotation.swing(ground.normal, np.array([0.0, 1.0, 0.0])))
    vertices = mesh.vertices @ turn.T
    vertices[:, 1] -= ground.offset
    low, high = vertices.min(0), vertices.max(0)
    vertices[:, [0, 2]] -= ((low + high) / 2)[[0, 2]]
    return replace(mesh, vertices=vertices)


def above_plane(mesh: Mesh, normal: Float, offset: float) -> Mesh:
    """Returns the part of a mesh where normal (3,) . x > offset, cut along that plane."""
    heights = np.asarray(mesh.vertices @ normal - offset)
    inside = heights[mesh.faces] > 0
    count = inside.sum(1)
    # The corner that is alone on its side comes first.
    alone = np.where(count == 1, inside.argmax(1), (~inside).argmax(1))
    turned = np.take_along_axis(mesh.faces, (alone[:, None] + np.arange(3)) % 3, 1).astype(np.int64)
    one, two = turned[count == 1], turned[count == 2]
    ends = np.sort(np.concatenate([one[:, [0, 1]], one[:, [0, 2]], two[:, [0, 1]], two[:, [0, 2]]]), 1)
    edges, number = np.unique(ends, axis=0, return_inverse=True)
    cuts = np.split(number.reshape(-1) + len(mesh.vertices), np.cumsum([len(one), len(one), len(two)]))
    corner = [
        turned[count == 3],
        np.stack([one[:, 0], cuts[0], cuts[1]], 1),
        np.stack([two[:, 1], two[:, 2], cuts[2]], 1),
        np.stack([two[:, 2], cuts[3], cuts[2]], 1),
    ]
    share = heights[edges[:, :1]] / (heights[edges[:, :1]] - heights[edges[:, 1:]])

    def spread(values: Float) -> Float:
        return np.concatenate([values, values[edges[:, 0]] * (1 - share) + values[edges[:, 1]] * share])

    colours = None if mesh.colours is None else np.rint(spread(mesh.colours.astype(float))).astype(np.uint8)
    faces = np.concatenate(corner).astype(np.int32)
    whole = Mesh(spread(mesh.vertices), faces, mesh.name, colours)
    return submesh(whole, np.ones(len(faces), bool))
