"""The triangle mesh: vertices, faces, normals and areas, with welding, refinement and scaling to a height."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal

import numpy as np

from enliven.arrays import Bool, Float, Float32, Int, Int32, UInt8
from enliven.errors import InputError
from enliven.meshes.kernels import corner_sums, face_areas, face_vectors, first_of_position, split_long_edges
from enliven.meshes.materials import MeshMaterials, materials_within
from enliven.rotation import unit

Axis = Literal["x", "y", "z"]
_UP_ROTATIONS: dict[Axis, Float] = {
    "x": np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]),
    "y": np.eye(3),
    "z": np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]]),
}


_MAX_STANDING_OFFSET = 0.02
"""Maximum distance of the lowest point from height 0, as a fraction of the mesh's extent, for a mesh that was
modelled to stand on height 0."""
_LYING_RATIO = 4.0
"""If length divided by height is above this ratio, the mesh may lie on its side. A horse has a ratio of 1.5.
(A crocodile has a larger ratio, although it stands on its feet.)"""


_UNCOLOURED_SRGB = 204
"""sRGB grey value of the vertices of a mesh without colours, if it is joined with a coloured mesh."""
Paint = tuple[UInt8 | None, Float32 | None]
"""The vertex paint: (V, 3) sRGB colours and (V,) stiffness. Each is None if it is missing."""


@dataclass(frozen=True)
class Mesh:
    """A triangle mesh.

    Attributes:
        vertices: (V, 3) float64. In metres after :func:`fit_height`, before that in the unit of the file.
        faces: (F, 3) int32, counter-clockwise seen from outside.
        name: its display name.
        colours: (V, 3) uint8 sRGB, or None. If there are materials too, programs that cannot draw textures
            draw these colours.
        materials: the materials of the faces, or None.
        stiffness: (V,) float32 above 0, as painted by an artist. Above 1, the surface bends less when
            performers move it, and below 1 it bends more. None means 1 everywhere.

    Raises:
        InputError: if an array has the wrong shape, or a face refers to a missing vertex.
    """

    vertices: Float
    faces: Int32
    name: str = "mesh"
    colours: UInt8 | None = None
    materials: MeshMaterials | None = None
    stiffness: Float32 | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "vertices", np.ascontiguousarray(self.vertices, np.float64))
        object.__setattr__(self, "faces", np.ascontiguousarray(self.faces, np.int32))
        problem = ""
        if self.vertices.ndim != 2 or self.vertices.shape[1] != 3:
            problem = f"the vertices have the shape {self.vertices.shape}, expected (V, 3)"
        elif self.faces.ndim != 2 or self.faces.shape[1] != 3:
            problem = f"the faces have the shape {self.faces.shape}, expected (F, 3)"
        elif self.faces.size and not 0 <= self.faces.min() <= self.faces.max() < len(self.vertices):
            problem = f"a face refers to a vertex outside 0..{len(self.vertices) - 1}"
        elif self.colours is not None and self.colours.shape != (len(self.vertices), 3):
            problem = (
                f"the vertex colours have the shape {self.colours.shape}, expected ({len(self.vertices)}, 3)"
            )
        elif self.materials is not None and len(self.materials.of) != len(self.faces):
            problem = (
                f"{len(self.materials.of)} faces have a material, but the mesh has {len(self.faces)} faces"
            )
        elif self.stiffness is not None:
            problem = stiffness_error(self.stiffness, len(self.vertices))
        if problem:
            raise InputError(problem, where=f"mesh {self.name!r}", remedy="Export the mesh again.")

    def with_faces(self, keep: Bool | Int) -> Mesh:
        """Returns the mesh with all its vertices, but only the faces in ``keep`` (mask or numbers)."""
        materials = None if self.materials is None else self.materials.select_faces(keep)
        return replace(self, faces=self.faces[keep], materials=materials)

    def flip_faces(self, which: Bool | None = None) -> Mesh:
        """Returns the mesh with flipped faces: all faces, or only the faces in the mask ``which`` (F,)."""
        if which is None:
            which = np.ones(len(self.faces), bool)
        materials = None if self.materials is None else self.materials.flip_faces(which)
        faces = np.where(which[:, None], self.faces[:, ::-1], self.faces)
        return replace(self, faces=faces, materials=materials)

    @cached_property
    def area(self) -> float:
        """Surface area, square metres. Each face counts once."""
        return float(face_areas(self.vertices, self.faces).sum() / 2)

    @property
    def bounds(self) -> Float:
        """(2, 3) the lowest and the highest corner of the axis-aligned box."""
        return np.stack([self.vertices.min(0), self.vertices.max(0)])

    @property
    def paint(self) -> Float:
        """(V, 4) the vertex paint in a form that can be interpolated: sRGB, and the logarithm of the
        stiffness."""
        rows = np.zeros((len(self.vertices), 4))
        rows[:, :3] = _UNCOLOURED_SRGB if self.colours is None else self.colours
        rows[:, 3] = 0.0 if self.stiffness is None else np.log(self.stiffness, dtype=np.float64)
        return rows

    def paint_at(self, kept: Bool | Int) -> Paint:
        """Returns colours and stiffness of the vertices in ``kept`` (mask or numbers). Each is None if the
        mesh does not have it.
        """
        colours = None if self.colours is None else self.colours[kept]
        return colours, None if self.stiffness is None else self.stiffness[kept]

    def face_vectors(self) -> Float:
        """Returns (F, 3) each face's outward normal with a length of twice its area."""
        return np.asarray(face_vectors(self.vertices, self.faces))

    def face_normals(self) -> Float:
        """Returns (F, 3) unit normals, zero for a face without area."""
        return unit(self.face_vectors())

    def vertex_normals(self) -> Float:
        """Returns (V, 3) area-weighted unit normals, zero for a vertex without any face area."""
        return unit(corner_sums(self.faces, self.face_vectors(), len(self.vertices)))


def split_paint(rows: Float, *meshes: Mesh) -> Paint:
    """Converts ``rows`` (V, 4) in the form of :attr:`Mesh.paint` to colours and stiffness. Each is None if
    none of the meshes has it."""
    coloured = any(mesh.colours is not None for mesh in meshes)
    stiff = any(mesh.stiffness is not None for mesh in meshes)
    colours = np.clip(np.rint(rows[:, :3]), 0, 255).astype(np.uint8) if coloured else None
    return colours, np.exp(rows[:, 3]).astype(np.float32) if stiff else None


def stiffness_error(stiffness: Float32, count: int) -> str:
    """Checks the stiffness of ``count`` vertices. Returns a description of the error, or "" if the stiffness
    is valid."""
    if stiffness.shape != (count,):
        return f"the stiffness has the shape {stiffness.shape}, expected ({count},)"
    return (
        ""
        if (np.isfinite(stiffness) & (stiffness > 0)).all()
        else "the stiffness of a vertex is not finite or not above 0"
    )


def weld(mesh: Mesh) -> tuple[Mesh, Int]:
    """Merges vertices at equal positions. Returns the mesh, and (V,) the welded vertex of each vertex.

    Mesh files duplicate a vertex if its faces differ in normals, colours or texture coordinates. Welding
    removes these seams, so that connectivity can be computed. Paint is dropped, and faces keep their order.
    """
    first_equal = first_of_position(np.ascontiguousarray(mesh.vertices + 0.0))
    if np.array_equal(first_equal, np.arange(len(first_equal))):
        return Mesh(mesh.vertices, mesh.faces, mesh.name), first_equal
    kept_vertices = np.flatnonzero(first_equal == np.arange(len(first_equal)))
    number = np.zeros(len(first_equal), np.int64)
    number[kept_vertices] = np.arange(len(kept_vertices))
    welded_of = number[first_equal]
    return Mesh(mesh.vertices[kept_vertices], welded_of[mesh.faces].astype(np.int32), mesh.name), welded_of


def extract_submesh(mesh: Mesh, keep_faces: Bool) -> Mesh:
    """Returns the faces selected by ``keep_faces`` (F,), and the vertices that they use."""
    kept_mesh = mesh.with_faces(keep_faces)
    faces = kept_mesh.faces
    used = np.zeros(len(mesh.vertices), bool)
    used[faces] = True
    number = np.cumsum(used) - 1
    colours, stiffness = mesh.paint_at(used)
    vertices, faces = mesh.vertices[used], number[faces].astype(np.int32)
    return Mesh(vertices, faces, mesh.name, colours, kept_mesh.materials, stiffness)


def refine(mesh: Mesh, longest: float, most_vertices: int = 400_000) -> Mesh:
    """Subdivides a surface until no edge is longer than ``longest`` metres, so that it can bend smoothly.

    Long edges are split repeatedly. An edge is split at the same point in both of its faces, even if its
    vertices are duplicated, so no cracks open. The first V vertices are those of ``mesh``. The subdivision
    stops early if the next pass would exceed ``most_vertices``.
    """
    if not longest > 0:
        raise InputError(
            f"the maximum edge length {longest} m is not valid",
            where="refine",
            remedy="Pass a length above 0.",
        )
    while True:
        vertices, faces, parents, origin = split_long_edges(mesh.vertices, mesh.faces, longest)
        if len(parents) == 0 or len(vertices) > most_vertices:
            return mesh
        colours = mesh.colours
        if colours is not None:
            mean_colours = colours[parents].astype(np.uint16).sum(1) // 2
            colours = np.concatenate([colours, mean_colours.astype(np.uint8)])
        stiffness = mesh.stiffness
        if stiffness is not None:
            mean_stiffness = np.exp(np.log(stiffness[parents]).mean(1))
            stiffness = np.concatenate([stiffness, mean_stiffness.astype(np.float32)])
        materials = materials_within(mesh.materials, mesh.vertices[mesh.faces], vertices[faces], origin)
        mesh = Mesh(vertices, faces, mesh.name, colours, materials, stiffness)


def rotate_upright(mesh: Mesh, up: Axis) -> Mesh:
    """Rotates the mesh so that its axis ``up`` points along +Y. With z up, -Y is rotated to +Z, as Blender
    does.
    """
    return mesh if up == "y" else replace(mesh, vertices=mesh.vertices @ _UP_ROTATIONS[up].T)


def guess_up(mesh: Mesh) -> tuple[Axis, str]:
    """Guesses the up axis of a mesh from its lowest points. Returns the axis, and a note if another axis is
    possible (otherwise "").
    """
    low, high = mesh.vertices.min(0), mesh.vertices.max(0)
    size = high - low
    stands = (np.abs(low) <= _MAX_STANDING_OFFSET * size) & (size > 0)
    if stands[2] and not stands[1]:
        return "z", (
            "the mesh stands on the plane z = 0, so +Z is used as the up axis; if +Y is up, use --up y"
        )
    if max(size[0], size[2]) > _LYING_RATIO * size[1]:
        times = max(size[0], size[2]) / max(size[1], 1e-9)
        return "y", f"the mesh is {times:.0f} times longer than high if +Y is up; if +Z is up, use --up z"
    return "y", ""


def fit_height(mesh: Mesh, height: float, up: Axis = "y") -> Mesh:
    """Rotates a mesh upright, scales it to ``height`` metres, and places it on y = 0.

    The centre of its bounding box gets x = 0 and z = 0.

    Args:
        mesh: the mesh, in any unit.
        height: metres from the lowest to the highest point, after ``up`` was rotated to +Y.
        up: the axis of the mesh that points up. With z up, -Y is rotated to +Z, as Blender's export does.

    Raises:
        InputError: if the mesh has no extent along ``up``, or ``height`` is not positive.
    """
    if not (np.isfinite(height) and height > 0):
        raise InputError(
            f"the height {height} m is not valid", where=mesh.name, remedy="Pass a height above 0."
        )
    rotated_vertices = rotate_upright(mesh, up).vertices
    low, high = rotated_vertices.min(0), rotated_vertices.max(0)
    if not high[1] - low[1] > 1e-9 * max(1e-30, float((high - low).max())):
        raise InputError(
            f"the mesh is flat along the {up} axis, so it cannot be scaled to a height",
            where=mesh.name,
            remedy="Choose another up axis.",
        )
    base = np.array([(low[0] + high[0]) / 2, low[1], (low[2] + high[2]) / 2])
    return replace(mesh, vertices=(rotated_vertices - base) * (height / (high[1] - low[1])))
