"""What stands on the floor is cut out of a scan: the floor found, holes closed, the thing put upright."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from enliven import rotation
from enliven.arrays import Bool, Float, Int, Int32
from enliven.errors import InputError
from enliven.meshes import Mesh, shells, submesh
from enliven.modeling.mesh import triangulated
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

    It is closed where it stood; holes with short rims are closed, and larger ones stay open.

    Raises:
        InputError: where nothing stands there.
    """
    s = settings or CutOutSettings()
    above = above_plane(mesh, ground.normal, ground.offset + s.clearance)
    thing = _component(above, focus, s) if len(above.faces) else above
    if thing.area < s.least_area:
        what = "nothing that stands on the floor was scanned"
        raise InputError(
            what, where="scan", mend="Carry the camera round the thing, and look at it all the time."
        )
    vertices = levelled(thing, ground).vertices
    # What the cut took off its feet is given back to them.
    feet = vertices[:, 1] < s.clearance + 1e-9
    vertices[feet, 1] = 0.0
    return close_holes(replace(thing, vertices=vertices), feet, s)


def largest_part(mesh: Mesh) -> Mesh:
    """Returns the connected part with the most surface, standing on y = 0, its box centred on x and z."""
    label = np.asarray(shells(mesh.faces, len(mesh.vertices)))[mesh.faces[:, 0]]
    areas = np.linalg.norm(mesh.face_vectors(), axis=1)
    part = submesh(mesh, label == np.bincount(label, areas).argmax())
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


def _component(mesh: Mesh, focus: Float, s: CutOutSettings) -> Mesh:
    """Returns the connected part with the most surface about the focus."""
    label = np.asarray(shells(mesh.faces, len(mesh.vertices)))[mesh.faces[:, 0]]
    middles = mesh.vertices[mesh.faces].mean(1)
    near = np.exp(-np.square(middles - focus).sum(1) / s.about**2)
    areas = np.linalg.norm(mesh.face_vectors(), axis=1) * near
    return submesh(mesh, label == np.bincount(label, areas).argmax())


def close_holes(mesh: Mesh, feet: Bool, s: CutOutSettings) -> Mesh:
    """Returns the mesh with short rims closed, and those of which all vertices are ``feet`` (V,)."""
    rims = rims_of(mesh.faces)
    soles = [rim for rim in rims if feet[rim].all()]
    vertices, faces = [mesh.vertices], [mesh.faces.astype(np.int64)]
    if soles:
        flat = mesh.vertices[:, [0, 2]]
        # Seen from below, x is to the right and z is up.
        made = triangulated(np.ascontiguousarray(flat), [rim[::-1] for rim in soles])
        faces.append(_facing_down(made, mesh.vertices))
    count, colours = len(mesh.vertices), [] if mesh.colours is None else [mesh.colours]
    for rim in rims:
        length = np.linalg.norm(np.roll(mesh.vertices[rim], -1, 0) - mesh.vertices[rim], axis=1).sum()
        if feet[rim].all() or length > s.hole:
            continue
        vertices.append(mesh.vertices[rim].mean(0, keepdims=True))
        faces.append(np.stack([np.roll(rim, -1), rim, np.full(len(rim), count)], 1))
        if mesh.colours is not None:
            colours.append(np.rint(mesh.colours[rim].mean(0, keepdims=True)).astype(np.uint8))
        count += 1
    joined: Int32 = np.concatenate(faces).astype(np.int32)
    return Mesh(np.concatenate(vertices), joined, mesh.name, np.concatenate(colours) if colours else None)


def _facing_down(faces: Int, vertices: Float) -> Int:
    """Returns the faces with the corners of those that look up in the other order."""
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    up = np.cross(b - a, c - a)[:, 1] > 0
    faces[up] = faces[up, ::-1]
    return faces


def rims_of(faces: Int32) -> list[Int]:
    """Returns the loops of vertices round the holes of a mesh, along the sides of its faces."""
    sides = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]).astype(np.int64)
    key, back = sides[:, 0] << 32 | sides[:, 1], sides[:, 1] << 32 | sides[:, 0]
    after: dict[int, list[int]] = {}
    for a, b in sides[~np.isin(key, back)].tolist():
        after.setdefault(a, []).append(b)
    rims = []
    for start in list(after):
        while after.get(start):
            rim = [start]
            while rim[-1] != start or len(rim) == 1:
                if not after.get(rim[-1]):
                    break
                rim.append(after[rim[-1]].pop())
            if rim[-1] == start and len(rim) > 3:
                rims.append(np.array(rim[:-1]))
    return rims
