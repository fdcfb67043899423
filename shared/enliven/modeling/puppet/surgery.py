"""Cuts puppets in two. Both halves continue to move by their examples.

Nothing is baked. Each half of a cut keeps its control points. It gets new control points along the cut, and
wherever else its surface would deviate. In every key pose, these points lie on the old surface. So in its key
poses, a half has the same shape as before the cut.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from enliven.arrays import Float, Int32
from enliven.document import ControlPoint, ExampleCharacter, KeyPose, Project, PuppetLayer, unused
from enliven.examples.puppet_motion import convert_to_world_frame
from enliven.modeling.mesh.cut_pieces import Piece
from enliven.modeling.mesh.cut_surfaces import CutSurface
from enliven.modeling.mesh.mesh_cut import Cut, cut_by_stroke
from enliven.modeling.puppet.parts import (
    add_moment,
    align_puppet,
    evaluate_puppet_state,
    find_distinguishing_points,
    find_nearest_paired,
    find_needed_points,
    remove_ambiguous_poses,
    remove_points_from,
    remove_symmetry_plane,
    sample_spread_vertices,
    solve_surfaces,
    surface_of_puppet,
)

MAX_HALF_DEVIATION = 0.02
"""Maximum deviation of a half from its shape in the whole puppet, in a key pose, as a fraction of the mesh's
size. Smaller deviations are not visible.
"""
_FIRST_CUT_POINTS = 4
"""Initial number of new control points along the cut. Four points are enough to fix the border of a round
limb.
"""
_MAX_CUT_POINTS = 12
"""Maximum number of new control points per half. More control points slow the puppet down."""


def cut_puppet(
    project: Project,
    puppet_id: str,
    stroke: CutSurface,
    time: float,
    *,
    notes: list[str] | None = None,
) -> tuple[Project, tuple[str, str]]:
    """Cuts a puppet in two along a stroke, in its pose at ``time``. Both halves keep moving by examples.

    The pose of the whole puppet at ``time`` becomes a key pose, so that the halves keep this pose. A half
    with all of the feet continues to travel through the world. Any other half no longer travels, and moves
    about its position at ``time``.

    Args:
        stroke: a ``StrokeCut`` or ``PlaneCut`` in world metres.
        time: time of the project in seconds.
        notes: a list that receives sentences about the closing of the mesh and about the errors of the
            halves.

    Returns:
        The project, and the ids of both halves. The half with more feet keeps ``puppet_id``, and the other
            half gets a new id. If both have the same number of feet, the larger half keeps it. If both also
            have the same size, the near half keeps it.

    Raises:
        InputError: if the puppet does not exist, the time is not finite, or the stroke cuts nothing off.
    """
    puppet, messages = project.puppet(puppet_id), [] if notes is None else notes
    old_state, surface = evaluate_puppet_state(project, puppet, time), surface_of_puppet(puppet)
    posed = convert_to_world_frame(puppet, old_state, surface.solve_from_rest(old_state.places))
    cut = cut_by_stroke(puppet.mesh, None, stroke, posed)
    messages.extend(cut.notes)
    off_id = unused(puppet_id, project.characters)
    unfolded_puppet = remove_symmetry_plane(project, add_moment(project, puppet, time))
    places = [pose.places for pose in unfolded_puppet.poses]
    old_places = solve_surfaces(
        surface, np.array(places).reshape(len(places), len(unfolded_puppet.points), 3)
    )
    if puppet.symmetry is not None:
        messages.append(
            "The two halves have no plane of symmetry. The mirrored key poses were therefore "
            "stored as additional key poses."
        )
    halves = []
    for piece, name in zip(_order_by_feet(puppet, cut), (puppet_id, off_id), strict=True):
        half = _CutSide(project, unfolded_puppet, old_places, piece).build_puppet(name, messages)
        state = evaluate_puppet_state(project.with_characters(half), half, time)
        halves.append(align_puppet(half, state, puppet, old_state))
    return project.with_characters(*halves), (puppet_id, off_id)


def _order_by_feet(puppet: ExampleCharacter, cut: Cut) -> tuple[Piece, Piece]:
    """Returns both sides, the side with more feet first. If both have the same number, the larger side comes
    first.
    """
    feet = [point.vertex for point in puppet.points if point.foot]
    first, second = cut.larger_first
    first_count, second_count = (int(np.isin(feet, piece.kept).sum()) for piece in (first, second))
    return (second, first) if second_count > first_count else (first, second)


class _CutSide:
    """One side of a cut puppet while its control points are chosen."""

    def __init__(
        self,
        project: Project,
        puppet: ExampleCharacter,
        old_positions: Float,
        piece: Piece,
    ) -> None:
        self._puppet, self._piece = puppet, piece
        self._project, self._telling = project, find_distinguishing_points(project, self._puppet)
        self._old = piece.kept >= 0
        self._number = np.full(len(puppet.mesh.vertices), -1)
        self._number[piece.kept[self._old]] = np.flatnonzero(self._old)
        self._was = np.where(self._old[None, :, None], old_positions[:, np.maximum(piece.kept, 0)], 0.0)

    def build_puppet(self, name: str, notes: list[str]) -> ExampleCharacter:
        """Returns the half as a puppet called ``name``, with new control points where they are needed."""
        puppet, size = self._puppet, float(np.linalg.norm(np.ptp(self._puppet.mesh.vertices, axis=0)))
        own_layers = [
            replace(point, vertex=int(self._number[point.vertex]))
            for point in puppet.points
            if self._number[point.vertex] >= 0
        ]
        half = self._puppet_with_points(puppet, name, own_layers)
        begin = sample_spread_vertices(
            half.mesh.vertices,
            self._border_vertices(),
            [point.vertex for point in own_layers],
            _FIRST_CUT_POINTS,
        )
        tolerance = MAX_HALF_DEVIATION * size
        first = np.array(begin, np.int64)
        added, worst = find_needed_points(half, self._was, self._old, first, _MAX_CUT_POINTS, tolerance)
        leaders = find_nearest_paired(puppet.mesh, self._telling, [int(self._piece.kept[v]) for v in added])
        points, follow = list(own_layers), dict[str, str]()
        names = {point.name: point for point in puppet.points}
        for vertex, leader in zip(added, leaders, strict=True):
            point = ControlPoint(
                unused(f"{leader.name} cut" if leader else "cut", names),
                vertex,
                leader.joint if leader else "",
            )
            names[point.name] = point
            points.append(point)
            if leader:
                follow[point.name] = leader.name
        self._note_deviation(name, len(added), worst, size, notes)
        checked, removed = remove_ambiguous_poses(self._project, self._puppet_with_points(half, name, points))
        if removed:
            notes.append(
                f"{removed} key poses of {name!r} were removed, because the joints of {name!r} have "
                "the same pose in them."
            )
        return checked.with_changes(layers=self._fitting_layers(follow, {point.name for point in points}))

    def _puppet_with_points(
        self, puppet: ExampleCharacter, name: str, points: list[ControlPoint]
    ) -> ExampleCharacter:
        """Returns a puppet with this side's mesh and the control points ``points``. In each key pose, the
        points are on the old surface."""
        vertices = [point.vertex for point in points]
        poses = zip(self._puppet.poses, self._was[:, vertices], strict=True)
        return puppet.with_changes(
            id=name,
            mesh=replace(self._piece.mesh, name=name),
            points=tuple(points),
            poses=tuple(KeyPose(pose.take, pose.time, places) for pose, places in poses),
            layers=(),
        )

    def _note_deviation(self, name: str, added: int, worst: float, size: float, notes: list[str]) -> None:
        notes.append(
            f"The puppet {name!r} got {added} new control points. Its key poses deviate from the "
            f"original poses by at most {1000 * worst:.1f} mm ({100 * worst / size:.2f} % of the "
            "whole puppet's size)."
        )

    def _border_vertices(self) -> Int32:
        """Returns the numbers (K,) of the kept vertices next to the cut."""
        faces = self._piece.mesh.faces
        near = faces[~self._old[faces].all(1)]
        return np.unique(near[self._old[near]])

    def _fitting_layers(self, follow: dict[str, str], names: set[str]) -> tuple[PuppetLayer, ...]:
        """Returns the layers with only the control points that still exist. A new control point is added to
        the layers of the control point that it follows."""
        feet = {point.name for point in self._puppet.points if point.foot}
        out = []
        for layer in self._puppet.layers:
            travels = layer.travel and feet <= names
            following_points = tuple(new for new, leader in follow.items() if leader in layer.points)
            new_layer = remove_points_from(
                replace(layer, points=(*layer.points, *following_points), travel=travels), names
            )
            if new_layer.points or not layer.points:
                out.append(new_layer)
        return tuple(out)
