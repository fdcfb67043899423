"""Postures proposed by the parts: the trunk's frame from the modes, then the whole model brought to them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from enliven.arrays import Float, Float32
from enliven_edge.parts.anatomy import ANCHOR_FRAMES, ANCHORS, BELOW, CARRIES, USUAL_AREA
from enliven_edge.parts.forest import PartForest
from enliven_edge.parts.labels import FACINGS, MIRRORED, Part, facing_of
from enliven_edge.parts.modes import Modes, part_modes
from enliven_edge.parts.sideless import merged
from enliven_edge.tracking import model, ranges
from enliven_edge.tracking.alignment import align
from enliven_edge.tracking.capsules import nearest_capsules
from enliven_edge.tracking.observation import Observation
from enliven_edge.tracking.posture import Posture, forward, rotation

_TRUNK = np.array([Part.HEAD, 1, 2, 3, 4, Part.UPPER_ARM_LEFT, Part.UPPER_ARM_RIGHT, 11, 12])
_TRUNK_TRUST = np.array([0.6, 1.0, 1.0, 1.0, 1.0, 0.5, 0.5, 0.4, 0.4])
_WIDTHS = (1.0, 0.35)
"""Metres beyond which a mode is doubted, one alignment after the other."""
_STEPS = 10
_CARRY = CARRIES.T.astype(np.float32)
_CARRY_EITHER = np.maximum(_CARRY, _CARRY[MIRRORED])
_NO_AFFINITY = np.zeros((0, 0), np.float32)
_YAWS = (0.0, np.pi, 0.5 * np.pi, -0.5 * np.pi)

_TO_THE_SENSOR = 0.05
"""What facing the sensor is worth before anything is seen, as a mean log likelihood; facing away costs it."""


@dataclass(frozen=True)
class Seen:
    """What the forest says of one observation.

    Attributes:
        points: (M, 3) metres, world frame: the observation's.
        probabilities: (M, 17) float32 of the parts at the observation's points.
        area: (M,) square metres that each point stands for.
        facing: (8,) mean log likelihood, over the points, of every way to face, see
            :func:`enliven_edge.parts.labels.facing_of`.
    """

    points: Float32
    probabilities: Float32
    area: Float
    facing: Float

    def thinned(self, step: int) -> Seen:
        """The same of every ``step``-th point; how people face is of all of them."""
        some = slice(None, None, step)
        points, probabilities = self.points[some], self.probabilities[some]
        return Seen(
            np.ascontiguousarray(points),
            np.ascontiguousarray(probabilities),
            step * self.area[some],
            self.facing,
        )

    @cached_property
    def modes(self) -> Modes:
        """Where the 17 parts are."""
        return part_modes(self.points, self.probabilities, self.area)

    @cached_property
    def kinds(self) -> Modes:
        """Where the 9 kinds of parts are, left or right."""
        return part_modes(self.points, merged(self.probabilities), self.area)

    @cached_property
    def likelihood(self) -> Float32:
        """(M, 20) how likely each point is on each capsule of the model."""
        return np.asarray(self.probabilities @ _CARRY)

    @cached_property
    def surface(self) -> Float32:
        """(6, M) the points without normals, as :func:`capsules.nearest_capsules` takes them."""
        out = np.zeros((6, len(self.points)), np.float32)
        out[:3] = self.points.T
        return out

    def affinity(self, metres: float) -> Float32:
        """(20, M) metres by which a point is farther from a capsule than it seems, at most ``metres``."""
        return np.ascontiguousarray((np.float32(metres) * (1.0 - self.likelihood)).T)

    def sideless_affinity(self, metres: float) -> Float32:
        """The same where a left part is as good as a right one."""
        either = np.minimum(1.0, self.probabilities @ _CARRY_EITHER)
        return np.ascontiguousarray((np.float32(metres) * (1.0 - either)).T)


def look(forest: PartForest, observation: Observation) -> Seen:
    """The parts at the points of an observation."""
    z, mask, _, camera, pose = observation.view
    rows, columns = observation.pixels[:, 0], observation.pixels[:, 1]
    # Upright in the image: the way that the world's up goes in it.
    roll = float(np.arctan2(pose[1, 0], -pose[1, 1]))
    leaves = forest.leaves(np.where(mask, z, 0.0), camera, rows, columns, roll=roll)
    depth = z[rows, columns]
    share = np.count_nonzero(mask) / max(1, len(rows))
    area = share * depth * depth / (camera[0] * camera[1])
    return Seen(observation.points, forest.parts_of(leaves), area, forest.facing_of(leaves))


def proposals(seen: Seen, lengths: Float, eye: Float) -> list[tuple[float, Posture]]:
    """Postures that bring the model's parts to their modes, each with what it leaves, the best first.

    From a trunk turned as the modes say, and to four sides; and the best of them with left and right
    exchanged and turned about, because a front is easily taken for a back.

    Args:
        lengths: (12,) the person's, or an average person's.
        eye: (3,) the sensor, world frame.
    """
    mass = seen.modes.mass[:, 0]
    targets = _below_surface(seen.modes.positions[:, 0], eye)
    found = [_aligned(start, targets, mass) for start in _starts(targets, mass, lengths, eye)]
    found.sort(key=lambda pair: pair[0])
    swapped = _aligned(turned_about(found[0][1]), targets[MIRRORED], mass[MIRRORED])
    best = found[0]
    others = [pair for pair in found[1:] if _differ(pair[1], best[1])]
    return [best, swapped, *others[:1]]


def drawn(posture: Posture, seen: Seen, eye: Float) -> Posture:
    """The posture brought from where it is to where the parts are seen, its lengths kept."""
    targets = _below_surface(seen.modes.positions[:, 0], eye)
    return _aligned(posture, targets, seen.modes.mass[:, 0])[1]


def _below_surface(positions: Float, eye: Float) -> Float:
    """(17, 3) the middles of the parts, behind their seen surfaces."""
    away = positions - eye
    away /= np.linalg.norm(away, axis=1, keepdims=True) + 1e-9
    return np.asarray(positions + BELOW[:, None] * away)


def trust(mass: Float) -> Float:
    """(17,) how sure each mode is, from its square metres."""
    return np.asarray(np.minimum(1.0, mass / (0.5 * USUAL_AREA)) ** 2)


def _aligned(start: Posture, targets: Float, mass: Float) -> tuple[float, Posture]:
    """A start brought to the modes: at first wherever they are, then doubting those that do not fit."""
    weights, posture, energy = 0.03 * trust(mass), start, 0.0
    for width in _WIDTHS:
        posture, energy = align(
            posture, ANCHOR_FRAMES, ANCHORS, targets, weights, width=width, iterations=_STEPS
        )
    return energy, posture


def _starts(targets: Float, mass: Float, lengths: Float, eye: Float) -> list[Posture]:
    """Relaxed postures about a trunk turned as its modes are, and to four sides of the sensor."""
    centre = np.average(targets, axis=0, weights=mass + 1e-9)
    facing = float(np.arctan2(eye[0] - centre[0], eye[2] - centre[2]))
    turns = [rotation(y=facing + yaw) for yaw in _YAWS]
    weights = trust(mass)[_TRUNK] * _TRUNK_TRUST
    relaxed = _anchor_points(Posture(np.zeros(3), ranges.RELAXED, lengths))[_TRUNK]
    if weights.sum() > 1.0:
        turns.insert(0, _turn_between(relaxed, targets[_TRUNK], weights))
    made = []
    for turn in turns:
        rotations = ranges.RELAXED.copy()
        rotations[model.PELVIS] = turn
        moved = targets[_TRUNK] - relaxed @ turn.T
        position = np.average(moved, axis=0, weights=weights + 1e-6)
        made.append(Posture(position, rotations, lengths.copy()))
    return made


def _turn_between(points: Float, targets: Float, weights: Float) -> Float:
    """(3, 3) the rotation that brings weighted points nearest to their targets (Kabsch)."""
    share = weights / weights.sum()
    a, b = points - share @ points, targets - share @ targets
    u, _, v = np.linalg.svd((b * share[:, None]).T @ a)
    flip = np.diag([1.0, 1.0, np.linalg.det(u @ v)])
    return np.asarray(u @ flip @ v)


def _anchor_points(posture: Posture) -> Float:
    """(17, 3) where a posture has its parts, world frame."""
    world, pivots, _ = forward(posture.position, posture.rotations, posture.lengths)
    return np.asarray(
        pivots[ANCHOR_FRAMES] + np.einsum("pab,pb->pa", world[ANCHOR_FRAMES], ANCHORS @ posture.lengths)
    )


def turned_about(posture: Posture) -> Posture:
    """The posture turned half about its trunk's axis, the limbs of either side where the other's were."""
    made = posture.copy()
    made.rotations = ranges.mirrored(posture.rotations)
    made.rotations[model.PELVIS] = posture.rotations[model.PELVIS] @ rotation(y=np.pi)
    return made


def _differ(one: Posture, other: Posture) -> bool:
    """Whether some joint is in a plainly different place."""
    return bool(np.linalg.norm(one.joints() - other.joints(), axis=1).max() > 0.15)


def agreement(seen: Seen, posture: Posture) -> float:
    """The mean probability, over the points, of the part that the posture has there: in [0, 1].

    The agreement of a posture and of one turned about tells front from back, and left from right.
    """
    which = np.empty(len(seen.points), np.int32)
    nearest_capsules(which, seen.surface, _NO_AFFINITY, *posture.capsules(), np.float32(0.0))
    return float(seen.likelihood[np.arange(len(which)), which].mean())


def facing_score(seen: Seen, posture: Posture, eye: Float) -> float:
    """How likely it is that somebody seen so faces as the posture does: 0 for the likeliest way, else less.

    The unit is that of a mean log likelihood; interpolated between the eight ways that the forest tells.
    Who might as well face either way faces the sensor.
    """
    chest = posture.rotations[model.PELVIS] @ posture.rotations[model.CHEST]
    turns = facing_of(chest[:, 0], posture.position, eye) * FACINGS / (2.0 * np.pi)
    before = int(np.floor(turns))
    share = turns - before
    ways = seen.facing - seen.facing.max()
    likely = (1.0 - share) * ways[before % FACINGS] + share * ways[(before + 1) % FACINGS]
    return float(likely + _TO_THE_SENSOR * np.cos(2.0 * np.pi * turns / FACINGS))
