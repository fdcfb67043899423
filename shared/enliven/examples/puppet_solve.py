"""Solves the motion of a layer's whole take by a puppet's examples: control point trajectories, and the path
in the world (section 5).
"""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property

import numpy as np

from enliven.arrays import Bool, Complex, Float, Int
from enliven.document import Constraint, Coupling, ExampleCharacter, Project, PuppetLayer
from enliven.errors import InputError
from enliven.examples.mapping import ExampleMap
from enliven.examples.performer import PerformerClip
from enliven.examples.performers import match_performer
from enliven.examples.poses import Examples
from enliven.examples.puppet_examples import (
    MotionInputs,
    build_examples,
    collect_motion_inputs,
    find_reference_skeleton,
    select_pairs,
)
from enliven.examples.puppet_trajectory import PuppetMotion
from enliven.examples.spacetime.constraints import convert_constraints
from enliven.examples.spacetime.following import (
    PathFollower,
    complex_from_floor,
    floor_from_complex,
    limit_length,
)
from enliven.examples.spacetime.locomotion import PlacedMotion, check_switches
from enliven.examples.spacetime.planting import lock_feet
from enliven.examples.travel import PerformerFeet, convert_take, layer_travel, performer_feet
from enliven.skeletons.facing import find_facing, rotate_about_y

_FEET_RETURN_S = 0.3
"""Duration, in seconds, in which displaced feet return to their positions at the end of a take. The mesh
moves over its standing foot meanwhile, so the time is long enough to avoid a jump."""


def solve_motion(material: MotionInputs) -> PuppetMotion:
    """Solves the motion of a layer.

    Raises:
        InputError: if data is missing, or constraints contradict one another.
    """
    solve = _MotionSolve(material)
    places = solve.solve_places()
    if not solve.travels:
        return solve.create_motion(places, None, np.zeros(len(places)))
    sense = -1.0 if material.layer.mirrored else 1.0
    yaw = sense * material.layer.weight * (solve.converted_take.yaw - solve.converted_take.yaw[0])
    placed_motion = solve.place_in_world(places, yaw)
    level = solve.level_constraints(placed_motion)
    if level:
        places = solve.solve_places(level, places)
        placed_motion = solve.place_in_world(places, yaw)
    placed_motion, foot_displacements = solve.follow_path(placed_motion)
    places = solve.plant_feet(solve.displace_feet(places, foot_displacements, yaw), placed_motion, yaw)
    return solve.create_motion(places, placed_motion, yaw)


def convert_to_reference(material: MotionInputs) -> tuple[Examples, PerformerClip]:
    """Returns the examples of a layer, and its take converted to the reference performer.

    Raises:
        InputError: if data is missing.
    """
    solve = _MotionSolve(material)
    return solve.examples, solve.converted_take


def check_layer(project: Project, puppet: ExampleCharacter, layer: PuppetLayer) -> None:
    """Checks the constraints and contact switches of a layer without solving the motion.

    Raises:
        InputError: if data is missing, constraints contradict one another, or switches are out of order.
    """
    _MotionSolve(collect_motion_inputs(project, puppet, layer)).check()


class _MotionSolve:
    """The steps of solving a layer's motion."""

    def __init__(self, material: MotionInputs) -> None:
        self._material, self._layer, points = material, material.layer, material.points
        point_names = self._layer.points
        self._moved = [k for k, point in enumerate(points) if not point_names or point.name in point_names]
        self._feet = [k for k in self._moved if points[k].foot]
        mesh = material.mesh()
        self._rest = mesh.vertices[[point.vertex for point in points]]
        travel = layer_travel(material)
        steps = tuple(k for k in travel.feet if k in self._moved)
        self._travel = travel if steps == travel.feet else replace(travel, feet=())
        footed = bool(self._feet) or not any(point.foot for point in points)
        self.travels = self._layer.travel and footed and self._layer.weight > 0.0
        shown = [load_clip() for load_clip in material.shown]
        example_inputs = material.puppet, mesh, points, material.poses, shown, material.symmetry
        self.examples = select_pairs(build_examples(*example_inputs), self._moved)
        self._mapping = ExampleMap(self.examples, material.examples)
        take, joints = material.take(), self.examples.joints
        reference = find_reference_skeleton(
            [clip.skeleton for clip in shown], [point.joint for point in points]
        )
        self._take, self._role = take, match_performer(reference, take.skeleton, joints, take.id)
        self._asked: tuple[Constraint, ...] = (
            *self._layer.positions,
            *self._layer.velocities,
            *self._layer.couplings,
        )

    @cached_property
    def converted_take(self) -> PerformerClip:
        """The layer's take, converted to the reference performer."""
        return convert_take(self._take, self._role)

    def check(self) -> None:
        """Checks that the constraints and contact switches can be met."""
        convert_constraints(self._asked, self.examples, len(self._take.turns), self._take.step)
        if self._layer.switches is not None:
            check_switches(self._layer.switches, len(self._take.turns))

    def solve_places(self, level: tuple[Coupling, ...] = (), known: Float | None = None) -> Float:
        """Solves the control points (F, P, 3) in the mesh's frame, metres. If ``level`` couples feet, the
        other points are copied from the ``known`` solution.
        """
        control_points = np.tile(self._rest, (len(self.converted_take.poses), 1, 1))
        solve_inputs = self.converted_take.poses, self.converted_take.step, (*self._asked, *level)
        known_points = None if known is None else known[:, self._moved]
        control_points[:, self._moved] = self._mapping.solve(*solve_inputs, known=known_points)
        return control_points

    def place_in_world(self, places: Float, yaw: Float) -> PlacedMotion:
        """Returns the motion of control points (F, P, 3) in the world. Only the contact of the mesh's own
        feet moves the mesh."""
        mixed = self._rest + self._layer.weight * (places - self._rest)
        if self._performer_feet is None:
            no_root = np.zeros((len(places), 3))
            return PlacedMotion(rotate_about_y(mixed, yaw[:, None]), no_root, _make_empty_anchors(places), ())
        placed = self._performer_feet.place_in_world(
            mixed, yaw, self._alternating_stance, self._layer.switches
        )
        # The control points of the feet keep the height above the soles that they have in the rest pose.
        placed.root[:, 1] += self._rest[self._feet, 1].min()
        if self._travel.feet:
            return placed
        # If the feet do not step alternately, they form a base. Keep the centre of this base in place.
        rotated = placed.world - placed.root[:, None]
        base_drift = rotated[:, self._feet].mean(1) - rotated[0, self._feet].mean(0)
        root = np.where([True, False, True], -base_drift, placed.root)
        return replace(placed, root=root, world=rotated + root[:, None], anchors=_make_empty_anchors(places))

    @cached_property
    def path(self) -> Complex:
        """The path on the floor that the mesh follows: (F,) complex numbers x + iz, metres."""
        facing, mirrored = find_facing(self._take.skeleton), self._layer.mirrored
        return self._layer.weight * self._travel.compute_path(
            self.converted_take, facing, self._role.size, mirrored
        )

    def follow_path(self, placed: PlacedMotion) -> tuple[PlacedMotion, Complex]:
        """Pulls the motion towards the performer's path. Returns the motion, and the displacements (F, K) of
        the feet from their positions in the mesh, metres.
        """
        # The layer's weight scales the whole motion, including the drift limit: half the weight gives half
        # the motion.
        size = self._layer.weight * float(np.linalg.norm(np.ptp(self._rest, axis=0)))
        feet = self._held_feet
        following = PathFollower(size, self._material.locomotion, self.converted_take.step, len(feet))
        standing = np.zeros((len(placed.root), 0), np.bool_)
        if feet:
            standing = self._alternating_stance | (placed.anchors[:, None] == feet)
            standing &= (placed.anchors >= 0)[:, None]
        pulls, held, pull = (
            np.empty(len(standing), np.complex128),
            np.empty(standing.shape, np.complex128),
            0j,
        )
        own_path = complex_from_floor(placed.root) - complex_from_floor(placed.root[0])
        moves = np.diff(own_path, prepend=0j)
        offsets = self.path - own_path
        frames = zip(offsets.tolist(), standing.tolist(), moves.tolist(), strict=True)
        for frame, (offset, stands, moved) in enumerate(frames):
            pull += following.compute_correction(offset - pull, stands, moved)
            pulls[frame], held[frame] = pull, following.held
        pulls += self._return_feet_at_end(held, placed.anchors, offsets - pulls, following.farthest)
        pull_positions = floor_from_complex(pulls)
        placed = replace(
            placed, root=placed.root + pull_positions, world=placed.world + pull_positions[:, None]
        )
        placed.world[:, feet] += floor_from_complex(held)
        return placed, held

    def _return_feet_at_end(self, held: Complex, anchors: Int, offsets: Complex, farthest: float) -> Complex:
        """Fades the displacements (F, K) of the feet to zero at the end of the take. They are zero at the
        start too, so the take can loop.

        Returns the shift (F,) of the root that keeps the anchor in place meanwhile. The anchor slides if the
        mesh would be more than ``farthest`` metres from the path.

        Args:
            offsets: (F,) displacements from the mesh to its path, metres.
        """
        remaining = np.arange(len(held))[::-1] * self.converted_take.step
        removed = held * np.maximum(1.0 - remaining / _FEET_RETURN_S, 0.0)[:, None]
        held -= removed
        shift, feet = np.zeros(len(held), np.complex128), self._held_feet
        for frame in np.flatnonzero(remaining < _FEET_RETURN_S)[1:].tolist() if feet else []:
            shift[frame] = shift[frame - 1]
            if anchors[frame] >= 0:
                foot = feet.index(int(anchors[frame]))
                shift[frame] += removed[frame, foot] - removed[frame - 1, foot]
            offset = complex(offsets[frame])
            shift[frame] = offset - limit_length(offset - shift[frame], max(abs(offset), farthest))
        return shift

    def displace_feet(self, places: Float, held: Complex, yaw: Float) -> Float:
        """Returns control points (F, P, 3) in the mesh's frame, with feet displaced by (F, K) metres."""
        if held.shape[1] == 0 or not held.any():
            return places
        displaced = places.copy()
        displaced[:, self._held_feet] += (
            rotate_about_y(floor_from_complex(held), -yaw[:, None]) / self._layer.weight
        )
        return displaced

    def plant_feet(self, places: Float, placed: PlacedMotion, yaw: Float) -> Float:
        """Returns the control points (F, P, 3) with feet locked while they stand."""
        locomotion, weight = self._material.locomotion, self._layer.weight
        if locomotion.plant <= 0.0 or not self._travel.feet:
            return places
        mixed = self._rest + weight * (places - self._rest)
        locked = lock_feet(
            mixed, yaw, placed, self._feet, self._alternating_stance, self.converted_take.step, locomotion
        )
        return places + (locked - mixed) / weight

    @property
    def _held_feet(self) -> list[int]:
        """Numbers of the feet that stay in place while the mesh is pulled back to the path. These are all
        feet if the mesh steps, and otherwise none.
        """
        return self._feet if self._travel.feet else []

    @cached_property
    def _performer_feet(self) -> PerformerFeet | None:
        """The performer's feet, or None if no control point is a foot."""
        if not self._feet:
            return None
        rows = [self._moved.index(k) for k in self._feet]
        return performer_feet(
            self._take.skeleton, self._role, self.converted_take, self._feet, self._material.locomotion, rows
        )

    @cached_property
    def _alternating_stance(self) -> Bool:
        """(F, K) True for alternating feet while they stand."""
        assert self._performer_feet is not None
        return self._performer_feet.find_standing_feet() & np.isin(self._feet, self._travel.feet)

    def level_constraints(self, placed: PlacedMotion) -> tuple[Coupling, ...]:
        """Returns constraints that give two feet equal heights when the anchor changes. Constraints that
        contradict the user's are left out.
        """
        if not self._layer.level_feet or not self._travel.feet:
            return ()
        couplings = placed.create_level_constraints([point.name for point in self._material.points])
        problem_size = self.examples, len(self.converted_take.poses), self.converted_take.step
        if _constraints_agree((*self._asked, *couplings), *problem_size):
            return couplings
        accepted: tuple[Coupling, ...] = ()
        for coupling in couplings:
            if _constraints_agree((*self._asked, *accepted, coupling), *problem_size):
                accepted = (*accepted, coupling)
        return accepted

    def create_motion(self, places: Float, placed: PlacedMotion | None, yaw: Float) -> PuppetMotion:
        """Returns the solved motion, with read-only arrays, since all callers share it."""
        no_root, path = np.zeros((len(places), 3)), floor_from_complex(self.path)
        world_path = (no_root, no_root, _make_empty_anchors(places), ())
        if placed:
            world_path = (placed.root, path, placed.anchors, placed.switches)
        common = (self.converted_take.step, tuple(self._moved), places, self._rest, self._layer.weight, yaw)
        for array in (places, self._rest, yaw, *world_path[:3]):
            array.setflags(write=False)
        return PuppetMotion(*common, *world_path, self.travels, self._role.notes)


def _make_empty_anchors(places: Float) -> Int:
    """Returns the anchors (F,) of a motion (F, P, 3) in which no foot ever stands. All are -1."""
    return np.full(len(places), -1, np.int64)


def _constraints_agree(
    constraints: tuple[Constraint, ...], examples: Examples, frames: int, step: float
) -> bool:
    try:
        convert_constraints(constraints, examples, frames, step)
    except InputError:
        return False
    return True
