"""A layer's whole take through a puppet's examples: trajectories, and the way in the world (section 5)."""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property

import numpy as np

from enliven.arrays import Bool, Float
from enliven.document import Constraint, Coupling, Project, Puppet, PuppetLayer
from enliven.errors import InputError
from enliven.examples.mapping import ExampleMap
from enliven.examples.performer import PerformerClip, performed
from enliven.examples.performers import cast
from enliven.examples.poses import Examples
from enliven.examples.puppet_examples import Material, examples_with, material_of, reference_among, some_of
from enliven.examples.puppet_trajectory import PuppetMotion
from enliven.examples.spacetime import (
    PlacedMotion,
    check_switches,
    conditions_of,
    drawn_back,
    find_switches,
    locate,
    planted,
    standing_feet,
)
from enliven.mapping import turned_about_y


def solved(material: Material) -> PuppetMotion:
    """The motion of a layer.

    Raises:
        InputError: where something is missing, or constraints contradict one another.
    """
    solve = _Solve(material)
    places = solve.places()
    if not solve.travels:
        return solve.motion(places, None, np.zeros(len(places)))
    sense = -1.0 if material.layer.mirrored else 1.0
    yaw = sense * material.layer.weight * (solve.took.yaw - solve.took.yaw[0])
    placed = solve.located(places, yaw)
    level = solve.level(placed)
    if level:
        places = solve.places(level, places)
        placed = solve.located(places, yaw)
    return solve.motion(solve.planted(places, placed, yaw), placed, yaw)


def seen_by(material: Material) -> tuple[Examples, PerformerClip]:
    """The examples of a layer, and its take as the reference performer would have made it.

    Raises:
        InputError: where something is missing.
    """
    solve = _Solve(material)
    return solve.examples, solve.took


def check_layer(project: Project, puppet: Puppet, layer: PuppetLayer) -> None:
    """Check, without solving, that the constraints and switches of a layer can be met.

    Raises:
        InputError: where something is missing, for constraints that contradict one another, and for switches
            out of order.
    """
    _Solve(material_of(project, puppet, layer)).check()


class _Solve:
    """The steps to a layer's motion."""

    def __init__(self, material: Material) -> None:
        self._material, self._layer, points = material, material.layer, material.points
        named = self._layer.points
        self._moved = [k for k, point in enumerate(points) if not named or point.name in named]
        self._feet = [k for k in self._moved if points[k].foot]
        mesh = material.mesh()
        self._rest = mesh.vertices[[point.vertex for point in points]]
        self.travels = self._layer.travel and bool(self._feet) and self._layer.weight > 0.0
        shown = [one() for one in material.shown]
        how = material.puppet, mesh, points, material.poses, shown, material.symmetry
        self.examples = some_of(examples_with(*how), self._moved)
        self._mapping = ExampleMap(self.examples, material.examples)
        take, joints = material.take(), self.examples.joints
        reference = reference_among([one.skeleton for one in shown], [point.joint for point in points])
        self._take, self._role = take, cast(reference, take.skeleton, joints, take.id)
        self._asked: tuple[Constraint, ...] = (
            *self._layer.positions,
            *self._layer.velocities,
            *self._layer.couplings,
        )

    @cached_property
    def took(self) -> PerformerClip:
        """The layer's take as the reference performer would have made it."""
        took = performed(self._take, self._role.joints)
        return replace(took, poses=self._role.seen(took.poses))

    def check(self) -> None:
        """Check that constraints and switches can be met."""
        conditions_of(self._asked, self.examples, len(self._take.turns), self._take.step)
        if self._layer.switches is not None:
            check_switches(self._layer.switches, len(self._take.turns))

    def places(self, level: tuple[Coupling, ...] = (), known: Float | None = None) -> Float:
        """(F, P, 3) metres in the mesh's frame; with feet coupled, upon what is ``known`` without."""
        out = np.tile(self._rest, (len(self.took.poses), 1, 1))
        how = self.took.poses, self.took.step, (*self._asked, *level)
        before = None if known is None else known[:, self._moved]
        out[:, self._moved] = self._mapping.solve(*how, known=before)
        return out

    def located(self, places: Float, yaw: Float) -> PlacedMotion:
        """The way of places (F, P, 3) in the world."""
        switches, how, step = self._layer.switches, self._material.locomotion, self.took.step
        if switches is None:
            switches = find_switches(self._seen, step, self._legs(), how)
        mixed = self._rest + self._layer.weight * (places - self._rest)
        placed = locate(mixed, yaw, step, switches, self._feet, how, self._stands)
        spread, theirs = (float(np.linalg.norm(p - p.mean(0))) for p in (self._rest, self.took.world[0]))
        leash = how.leash * float(np.linalg.norm(np.ptp(self._rest, axis=0)))
        across = np.array([-1.0 if self._layer.mirrored else 1.0, 1.0, 1.0])
        way = turned_about_y(self.took.root, -self.took.yaw[0]) * across
        placed = drawn_back(placed, way, step, spread / max(theirs, 1e-9), leash)
        # The mesh stands at rest: that control points of feet are a little above its soles stays so.
        placed.root[:, 1] += self._rest[self._feet, 1].min()
        return placed

    def planted(self, places: Float, placed: PlacedMotion, yaw: Float) -> Float:
        """The same places (F, P, 3) with feet that stand still."""
        how, weight = self._material.locomotion, self._layer.weight
        if how.plant <= 0.0:
            return places
        still = planted(places, yaw, placed, self._feet, self._stands, self.took.step, how)
        return places + (still - places) / weight

    @cached_property
    def _seen(self) -> Float:
        """(F, K, 3) metres, the performer's feet in the world."""
        return np.asarray(self.took.world[:, [self._moved.index(k) for k in self._feet]])

    @cached_property
    def _stands(self) -> Bool:
        """(F, K) which of them stand."""
        return standing_feet(self._seen, self.took.step, self._legs(), self._material.locomotion)

    def level(self, placed: PlacedMotion) -> tuple[Coupling, ...]:
        """Feet of equal height where the anchor changes, unless that contradicts what the user asked for."""
        if not self._layer.level_feet:
            return ()
        wanted = placed.couplings([point.name for point in self._material.points])
        room = self.examples, len(self.took.poses), self.took.step
        if _agree((*self._asked, *wanted), *room):
            return wanted
        kept: tuple[Coupling, ...] = ()
        for one in wanted:
            if _agree((*self._asked, *kept, one), *room):
                kept = (*kept, one)
        return kept

    def motion(self, places: Float, placed: PlacedMotion | None, yaw: Float) -> PuppetMotion:
        """The solved motion, with read-only arrays: all callers share it."""
        still, none = np.zeros((len(places), 3)), np.full(len(places), -1, np.int64)
        way = (placed.root, placed.anchors, placed.switches) if placed else (still, none, ())
        kept = (self.took.step, tuple(self._moved), places, self._rest, self._layer.weight, yaw)
        for array in (places, self._rest, yaw, way[0], way[1]):
            array.setflags(write=False)
        return PuppetMotion(*kept, *way, self.travels, self._role.notes)

    def _legs(self) -> float:
        """Metres along the bones from the root to the feet, on the average."""
        skeleton = self._take.skeleton
        joints = [self._role.joints[self._moved.index(k)] for k in self._feet]
        ways = [skeleton.path(0, skeleton.index(name)) for name in joints]
        return float(np.mean([skeleton.lengths[list(way)].sum() for way in ways])) or 1.0


def _agree(constraints: tuple[Constraint, ...], examples: Examples, frames: int, step: float) -> bool:
    try:
        conditions_of(constraints, examples, frames, step)
    except InputError:
        return False
    return True
