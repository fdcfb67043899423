"""A layer's whole take through a puppet's examples: trajectories, and the way in the world (section 5)."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from enliven.arrays import Float, Int
from enliven.errors import InputError
from enliven.examples.constraints import Constraint, Coupling, conditions_of
from enliven.examples.locomotion import Placed, Switch, check_switches, find_switches, locate, standing_feet
from enliven.examples.mapping import ExampleMap
from enliven.examples.performer import Performance, performed, turned_about_y
from enliven.examples.performers import cast
from enliven.examples.poses import Examples
from enliven.examples.puppet_examples import Material, examples_with, material_of, reference_among, some_of
from enliven.project import Project
from enliven.puppet import Puppet, PuppetLayer


@dataclass(frozen=True, eq=False)
class PuppetMotion:
    """What a layer makes of its whole take, one entry a frame of it.

    Attributes:
        step: seconds between frames.
        points: numbers of the control points that it moves.
        places: (F, P, 3) metres in the mesh's own frame; those that it does not move are at rest.
        rest: (P, 3) metres, the control points at rest.
        weight: of the layer.
        yaw: (F,) radians since the first frame; 0 where it does not travel.
        root: (F, 3) metres; 0 where it does not travel.
        anchors: (F,) which control point stands; -1 in flight and where it does not travel.
        switches: where contact and flight begin, as used; none where it does not travel.
        travels: whether it goes through the world.
        notes: what was guessed, as sentences for the user.
    """

    step: float
    points: tuple[int, ...]
    places: Float
    rest: Float
    weight: float
    yaw: Float
    root: Float
    anchors: Int
    switches: tuple[Switch, ...]
    travels: bool
    notes: tuple[str, ...] = ()

    @property
    def frames(self) -> int:
        """How many frames it has."""
        return len(self.places)

    def at(self, seconds: float) -> tuple[Float, float, Float]:
        """Places (P, 3), yaw and root (3,) at a time of the take; before and after it the first and last."""
        frame = float(np.clip(seconds / self.step, 0.0, self.frames - 1))
        return self.places_at(frame), *self.way_at(frame)

    def places_at(self, frame: float) -> Float:
        """(P, 3) metres, at a frame or between two."""
        before, after, part = self._between(frame)
        return np.asarray((1.0 - part) * self.places[before] + part * self.places[after])

    def way_at(self, frame: float, rounds: int = 0) -> tuple[float, Float]:
        """Yaw and root (3,) at a frame or between two, after the take was gone through ``rounds`` times.

        Between frames the anchor stays where it is, as it does at them.
        """
        before, after, part = self._between(frame)
        yaw = float((1.0 - part) * self.yaw[before] + part * self.yaw[after])
        root = (1.0 - part) * self.root[before] + part * self.root[after]
        anchor = int(self.anchors[after])
        if anchor >= 0:
            one, other = (self._standing(f, anchor) for f in (before, after))
            at = (1.0 - part) * one + part * other
            turned = [
                _turned(place - self.root[f], -self.yaw[f]) for place, f in ((one, before), (other, after))
            ]
            root = at - _turned((1.0 - part) * turned[0] + part * turned[1], yaw)
        return self._gone(yaw, np.asarray(root), rounds)

    def _gone(self, yaw: float, root: Float, rounds: int) -> tuple[float, Float]:
        """A yaw and a root after whole rounds, each of which begins where the one before ended.

        Round n maps x to R^n x + (1 + R + ... + R^(n-1)) offset, R the turn of one: a geometric series, which
        holds for n < 0 too.
        """
        if rounds == 0 or not self.travels:
            return yaw, root
        turn, offset = self._round()
        half = np.sin(0.5 * turn)
        series = rounds if abs(half) < 1e-9 else np.sin(0.5 * rounds * turn) / half
        gone = series * _turned(offset, 0.5 * (rounds - 1) * turn)
        return yaw + rounds * turn, _turned(root, rounds * turn) + gone

    def _round(self) -> tuple[float, Float]:
        """What a place in the world becomes with the next round: its turn about +Y, and an offset (3,).

        The anchor of the last frame stays where it is; in flight the root does. Heights stay.
        """
        turn, anchor = float(self.yaw[-1] - self.yaw[0]), int(self.anchors[-1])
        last, first = self.root[-1], self.root[0]
        if anchor >= 0:
            last, first = self._standing(-1, anchor), self._standing(0, anchor)
        return turn, np.asarray((last - _turned(first, turn)) * [1.0, 0.0, 1.0])

    def _standing(self, frame: int, point: int) -> Float:
        """(3,) metres, where a control point is in the world at a frame, by this layer alone."""
        mixed = self.rest[point] + self.weight * (self.places[frame, point] - self.rest[point])
        return np.asarray(_turned(mixed, self.yaw[frame]) + self.root[frame])

    def _between(self, frame: float) -> tuple[int, int, float]:
        before = min(int(frame), self.frames - 1)
        return before, min(before + 1, self.frames - 1), frame - before


def solved(material: Material) -> PuppetMotion:
    """The motion of a layer.

    Raises:
        InputError: where something is missing, or constraints contradict one another.
    """
    solve = _Solve(material)
    places = solve.places(())
    if not solve.travels:
        return solve.motion(places, None, np.zeros(len(places)))
    sense = -1.0 if material.layer.mirrored else 1.0
    yaw = sense * material.layer.weight * (solve.took.yaw - solve.took.yaw[0])
    placed = solve.located(places, yaw)
    level = solve.level(placed)
    if level:
        places = solve.places(level)
        placed = solve.located(places, yaw)
    return solve.motion(places, placed, yaw)


def seen_by(material: Material) -> tuple[Examples, Performance]:
    """The examples of a layer, and what it plays as they see it.

    Raises:
        InputError: where something is missing.
    """
    solve = _Solve(material)
    return solve.examples, solve.took


def check_layer(project: Project, puppet: Puppet, layer: PuppetLayer) -> None:
    """That what is asked of a layer can be met, without solving it.

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
        role = cast(reference, take.skeleton, joints, take.id)
        took = performed(take, role.joints)
        self.took = replace(took, poses=role.seen(took.poses))
        self._role = role
        self._asked: tuple[Constraint, ...] = (
            *self._layer.positions,
            *self._layer.velocities,
            *self._layer.couplings,
        )

    def check(self) -> None:
        """That constraints and switches can be met."""
        conditions_of(self._asked, self.examples, len(self.took.poses), self.took.step)
        if self._layer.switches is not None:
            check_switches(self._layer.switches, len(self.took.poses))

    def places(self, level: tuple[Coupling, ...]) -> Float:
        """(F, P, 3) metres in the mesh's frame, with feet coupled."""
        out = np.tile(self._rest, (len(self.took.poses), 1, 1))
        out[:, self._moved] = self._mapping.solve(self.took.poses, self.took.step, (*self._asked, *level))
        return out

    def located(self, places: Float, yaw: Float) -> Placed:
        """The way of places (F, P, 3) in the world."""
        switches, how, step = self._layer.switches, self._material.locomotion, self.took.step
        seen = self.took.world[:, [self._moved.index(k) for k in self._feet]]
        if switches is None:
            switches = find_switches(seen, step, self._legs(), how)
        stands = standing_feet(seen, step, self._legs(), how)
        mixed = self._rest + self._layer.weight * (places - self._rest)
        placed = locate(mixed, yaw, step, switches, self._feet, how, stands)
        # The mesh stands at rest: that control points of feet are a little above its soles stays so.
        placed.root[:, 1] += self._rest[self._feet, 1].min()
        return placed

    def level(self, placed: Placed) -> tuple[Coupling, ...]:
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

    def motion(self, places: Float, placed: Placed | None, yaw: Float) -> PuppetMotion:
        """What came out, as nobody can change it: it is shared by all who ask."""
        still, none = np.zeros((len(places), 3)), np.full(len(places), -1, np.int64)
        way = (placed.root, placed.anchors, placed.switches) if placed else (still, none, ())
        kept = (self.took.step, tuple(self._moved), places, self._rest, self._layer.weight, yaw)
        for array in (places, self._rest, yaw, way[0], way[1]):
            array.setflags(write=False)
        return PuppetMotion(*kept, *way, self.travels, self._role.notes)

    def _legs(self) -> float:
        """Metres along the bones from the root to the feet, on the average."""
        skeleton = self._material.take().skeleton
        joints = [self._role.joints[self._moved.index(k)] for k in self._feet]
        ways = [skeleton.path(0, skeleton.index(name)) for name in joints]
        return float(np.mean([skeleton.lengths[list(way)].sum() for way in ways])) or 1.0


def _agree(constraints: tuple[Constraint, ...], examples: Examples, frames: int, step: float) -> bool:
    try:
        conditions_of(constraints, examples, frames, step)
    except InputError:
        return False
    return True


def _turned(vector: Float, angle: float) -> Float:
    return np.asarray(turned_about_y(vector, np.asarray(angle)))
