"""RigMesh sketching: a closed stroke becomes a rigged part with skin weights in one step.

    shape_from_stroke(stroke, plane, depth, id) -> Shape

P. Borosan et al., "RigMesh: automatic rigging for part-based shape modeling and deformation", 2012. The
outline is triangulated, the chordal axis of the triangles becomes bones, the outline is inflated around it,
and skin weights are computed.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from enliven.arrays import Float, Int
from enliven.document import RiggedCharacter, Skeleton, skeleton_from_links, still_shape
from enliven.errors import InputError
from enliven.meshes import Mesh
from enliven.meshes.planar import triangulate_loops
from enliven.modeling.mesh.cut_loops import signed_area
from enliven.modeling.sketching.axis import Axis
from enliven.modeling.sketching.axis_bones import bones_from_axis, choose_root_joint
from enliven.modeling.sketching.chordal import chordal_axis
from enliven.modeling.sketching.inflate import inflate_outline
from enliven.modeling.sketching.outline import trace_outline
from enliven.modeling.skinning.heat_diffusion import bone_heat

_MAX_OUTLINE_POINTS = 200
"""Maximum number of points along the outline. It is enough for the fingers of a drawn hand."""
_MAX_VERTICES = 4000
"""Approximate maximum number of vertices of the mesh, so that drawing feels immediate."""
_MAX_AXIS_DEVIATION_RADII = 0.45
"""Maximum distance between the axis and its bone, as a multiple of the radius. A smaller value gives more
bones."""
_MAX_BONE_DIAMETERS = 8.0
"""Maximum length of a bone in diameters, so that long straight parts can bend."""
_SMOOTHING_PASSES = 6
"""Number of smoothing passes over the surface. They remove the ridge along the outline."""


@dataclass(frozen=True)
class SketchPlane:
    """The plane in which a stroke is drawn: ``origin + x right + y up``, in metres, with the viewer in
    front."""

    origin: Float
    right: Float
    up: Float

    def axes(self) -> Float:
        """Returns (3, 3) orthonormal rows: right, up, and towards the viewer."""
        right, up = np.array(self.right, np.float64), np.array(self.up, np.float64)
        right = right / max(float(np.linalg.norm(right)), 1e-300)
        up = up - (up @ right) * right
        if not (np.isfinite(right).all() and np.linalg.norm(up) > 1e-9 and np.linalg.norm(right) > 0.5):
            raise InputError(
                "the right vector and the up vector of the drawing plane are parallel or 0", where="stroke"
            )
        up = up / np.linalg.norm(up)
        return np.stack([right, up, np.cross(right, up)])


FRONT = SketchPlane(np.zeros(3), np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0]))
"""The plane z = 0, seen from +z."""


def shape_from_stroke(
    stroke: Float, plane: SketchPlane = FRONT, depth: float = 1.0, id: str = "part"
) -> RiggedCharacter:
    """Builds a shape at rest from a closed stroke.

    Args:
        stroke: (N, 2) metres in the plane.
        depth: thickness of the part in diameters. 1 is round.

    Raises:
        InputError: if the stroke crosses itself or encloses no area.
    """
    axes = plane.axes()
    outline = trace_outline(stroke, _MAX_OUTLINE_POINTS)
    fewer = _outline_point_count(outline, _MAX_VERTICES)
    if fewer < _MAX_OUTLINE_POINTS:
        outline = trace_outline(stroke, fewer)
    triangles, axis = make_flat_axis(outline)
    places, radii, links = bones_from_axis(axis, _MAX_AXIS_DEVIATION_RADII, _MAX_BONE_DIAMETERS)
    middles, widths = _find_inner_circles(axis)
    vertices, faces = inflate_outline(outline, triangles, middles, widths, depth, _SMOOTHING_PASSES)
    mesh = Mesh(np.asarray(plane.origin) + vertices @ axes, faces, id)
    skeleton = _build_skeleton(places, radii, links, plane, axes)
    return still_shape(id, skeleton, mesh, bone_heat(mesh, skeleton))


def _outline_point_count(outline: Float, vertices: int) -> int:
    """Returns the number of outline points for which the mesh has about ``vertices`` vertices. Its triangles'
    edges are as long as the outline's steps."""
    step = np.sqrt(7.5 * signed_area(outline) / vertices)
    length = float(np.linalg.norm(np.roll(outline, -1, 0) - outline, axis=1).sum())
    return max(48, int(length / step))


def make_flat_axis(outline: Float) -> tuple[Int, Axis]:
    """Returns (T, 3) triangles of an outline, and its chordal axis."""
    triangles = triangulate_loops(outline, [np.arange(len(outline))])
    return triangles, chordal_axis(outline, triangles)


def _find_inner_circles(axis: Axis) -> tuple[Float, Float]:
    """Returns the centres (K, 2) and radii (K,) of the circles to inflate: the inner points of the axis'
    chains."""
    inner = np.unique([i for chain in axis.chains for i in chain[1:-1]]).astype(np.int64)
    if len(inner) == 0:
        inner = np.arange(len(axis.points))
    return axis.points[inner], axis.radii[inner]


def _build_skeleton(
    places: Float, radii: Float, links: list[tuple[int, int]], plane: SketchPlane, axes: Float
) -> Skeleton:
    """Builds the skeleton in space, with the thickest joint as the root. Joints are named by branch and
    number."""
    positions = np.asarray(plane.origin) + places @ axes[:2]
    numbers = [str(i) for i in range(len(places))]
    tree, _ = skeleton_from_links(numbers, links, positions, choose_root_joint(places, radii, links))
    names, branch = ["root"], [""]
    letters = 0
    for j in range(1, len(tree)):
        parent = int(tree.parents[j])
        is_only_child = len(tree.children[parent]) == 1 and branch[parent]
        if not is_only_child:
            letters += 1
        branch.append(branch[parent] if is_only_child else _number_as_letters(letters))
        names.append(f"{branch[j]}{1 + sum(b == branch[j] for b in branch[:j])}")
    return Skeleton(tuple(names), tree.parents, tree.positions)


def _number_as_letters(number: int) -> str:
    """Converts a number to letters: 1 is a, 26 z, 27 aa."""
    text = ""
    while number:
        number, rest = divmod(number - 1, 26)
        text = chr(97 + rest) + text
    return text
