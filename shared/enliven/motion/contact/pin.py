"""Foot lock: feet stay in place during a contact, and the limb adapts by two-bone inverse kinematics.

    pin_feet(project, shape_id, joints, *, start=None, settings=ContactSettings()) -> Project
    unpin(project, shape_id, joints=None) -> Project
    resolve_pins(shape) -> list[HeldPin]                        # the player's input

A limb of more than two bones is treated as two rigid halves. The foot and its descendants keep their world
rotations, so a flat sole stays flat. If a stretched limb does not reach its position, the root is lowered as
far as allowed, smoothly over time. (Kovar, Schreiner & Gleicher, "Footskate cleanup for motion capture
editing", 2002.) If the position is still out of reach, the foot moves as near to it as possible.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from enliven.arrays import Bool, Float, Int32
from enliven.document import ContactSettings, Pin, Project, RiggedCharacter, Skeleton
from enliven.errors import InputError
from enliven.kernels import njit
from enliven.motion.kinematics.ik import two_bone
from enliven.motion.kinematics.quaternions import conj, load, mul, store, turn
from enliven.motion.kinematics.vectors import row

_MIN_BULGE_FRACTION = 1e-3
"""Minimum bulge of a limb at rest, as a fraction of its length, that defines a bend direction."""
_DEFAULT_BEND_DIRECTION = np.array([0.0, 0.0, 1.0])
"""(3,) bend direction of knees that are straight at rest, if the foot does not define a forward direction."""
_MIN_TOE_EXTENT_FRACTION = 0.05
"""Minimum forward extent of a foot that defines the forward direction, as a fraction of the limb's length."""


@dataclass(frozen=True, eq=False)
class HeldPin:
    """A pin with joint numbers instead of names: the limb bends at joint chain[middle], and joint chain[-1]
    is locked.

    Attributes:
        chain: (K,) int32 joints from the limb's start to the foot.
        middle: index in the chain of the joint that bends.
        side: (3,) the direction in which the limb bulges at rest.
        size: length of the limb, metres.
        kept: (N,) True for the bones that keep their world rotation, which are those that begin at the foot.
        settings: the contact thresholds.
        below: (B,) int32 the foot's joint and all its descendants.
        sole: height of the lowest joint in ``below`` above the sole of the mesh at rest, metres.
        ground: height of the floor under the shape at rest, at its position in the project, metres.
        stance: height of the foot's joint above this floor at rest, metres.
    """

    chain: Int32
    middle: int
    side: Float
    size: float
    kept: Bool
    settings: ContactSettings
    below: Int32
    sole: float
    ground: float
    stance: float


def pin_feet(
    project: Project,
    shape_id: str,
    joints: Sequence[int | str],
    *,
    start: int | str | None = None,
    settings: ContactSettings | None = None,
) -> Project:
    """Adds pins to joints of a shape, so that they stay in place while they touch the floor. Returns the
    edited project.

    Args:
        joints: the feet, by number or name. They are ankles, or toes if a ``start`` is given.
        start: the joint at which the limb begins. None means that the limb has two bones.
        settings: the contact thresholds. None means the defaults.

    Raises:
        InputError: if a joint does not exist, or no limb of two bones ends in it.
    """
    shape = project.shape(shape_id)
    skeleton = shape.skeleton
    pins = {pin.joint: pin for pin in shape.pins}
    for joint in joints:
        foot = _joint_index(skeleton, joint)
        hip = _grandparent_joint(skeleton, foot) if start is None else _joint_index(skeleton, start)
        chain = skeleton.path(hip, foot) if hip >= 0 else ()
        if len(chain) < 3 or hip not in chain[:1] or min(chain) != hip:
            problem = f"no limb with two bones ends at the joint {skeleton.names[foot]!r}"
            raise InputError(
                problem, where=f"shape {shape_id!r}", remedy="Choose the joint at the start of the limb."
            )
        name = skeleton.names[foot]
        pins[name] = Pin(name, skeleton.names[hip], settings or ContactSettings())
    return project.with_characters(shape.with_changes(pins=tuple(pins.values())))


def unpin(project: Project, shape_id: str, joints: Sequence[int | str] | None = None) -> Project:
    """Removes the pins of joints of a shape, or all pins if ``joints`` is None. Returns the edited
    project."""
    shape = project.shape(shape_id)
    names = (
        None if joints is None else {shape.skeleton.names[_joint_index(shape.skeleton, j)] for j in joints}
    )
    remaining_pins = tuple(pin for pin in shape.pins if names is not None and pin.joint not in names)
    return project.with_characters(shape.with_changes(pins=remaining_pins))


def resolve_pins(shape: RiggedCharacter) -> list[HeldPin]:
    """Returns the pins of a shape with their joints resolved. Pins of missing limbs are left out."""
    skeleton, pins = shape.skeleton, []
    for pin in shape.pins:
        if pin.joint not in skeleton.names or pin.start not in skeleton.names:
            continue
        chain = skeleton.path(skeleton.index(pin.start), skeleton.index(pin.joint))
        if len(chain) < 3 or min(chain) != chain[0]:
            continue
        middle, side = find_bend(skeleton, chain)
        keeps_turn = skeleton.parents == chain[-1]
        size = float(skeleton.lengths[list(chain[1:])].sum())
        below = np.array([j for j in range(len(skeleton)) if chain[-1] in skeleton.path(0, j)], np.int32)
        ground = skeleton.positions[:, 1].min()
        if shape.mesh is not None:
            ground = min(ground, shape.mesh.vertices[:, 1].min())
        sole = float(skeleton.positions[below, 1].min() - ground)
        stance = float(skeleton.positions[chain[-1], 1] - ground)
        limb = (np.array(chain, np.int32), middle, side, size, keeps_turn)
        pins.append(HeldPin(*limb, pin.settings, below, sole, float(ground + shape.place[1]), stance))
    return pins


def find_bend(skeleton: Skeleton, chain: Sequence[int]) -> tuple[int, Float]:
    """Returns the index of the joint nearest to the middle of a chain, and (3,) the direction in which the
    chain bulges there at rest.
    """
    positions = skeleton.positions[list(chain)]
    arc_length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(positions, axis=0), axis=1))])
    middle = 1 + int(np.abs(arc_length[1:-1] - arc_length[-1] / 2).argmin())
    line = positions[-1] - positions[0]
    fraction = line @ (positions[middle] - positions[0]) / max(float(line @ line), 1e-300)
    side = positions[middle] - positions[0] - fraction * line
    straight = float(np.linalg.norm(side)) < _MIN_BULGE_FRACTION * arc_length[-1]
    return middle, _toe_direction(skeleton, chain[-1], line) if straight else np.asarray(side)


def _toe_direction(skeleton: Skeleton, foot: int, limb: Float) -> Float:
    """Returns the direction (3,) of a foot's toes, perpendicular to its limb (3,). For a limb without a foot,
    the result is forward.
    """
    toe_vectors = [skeleton.vectors[toe] for toe in skeleton.children[foot]]
    length = max(float(np.linalg.norm(limb)), 1e-300)
    perpendiculars = [direction - (direction @ limb) / length**2 * limb for direction in toe_vectors]
    longest = max(
        perpendiculars,
        key=lambda direction: float(np.linalg.norm(direction)),
        default=_DEFAULT_BEND_DIRECTION,
    )
    return longest if np.linalg.norm(longest) > _MIN_TOE_EXTENT_FRACTION * length else _DEFAULT_BEND_DIRECTION


def _joint_index(skeleton: Skeleton, joint: int | str) -> int:
    if isinstance(joint, str):
        return skeleton.index(joint)
    if not 0 <= joint < len(skeleton):
        raise InputError(
            f"joint {joint} does not exist; the skeleton has {len(skeleton)} joints", where="skeleton"
        )
    return int(joint)


def _grandparent_joint(skeleton: Skeleton, joint: int) -> int:
    """Returns the joint two bones above ``joint``, or -1 if there is none."""
    parent = int(skeleton.parents[joint])
    return int(skeleton.parents[parent]) if parent >= 0 else -1


@njit(cache=True, nogil=True)
def pin_limb(parents, vectors, chain, middle, side, kept, rise, sink, weights, goals, drops, turns, joints):
    """Moves the end of a limb to its goal, by the fraction ``weights`` (T,), and updates its descendants.

    Args:
        vectors: (T or 1, N, 3) vector from each parent to its joint before the bone rotates, metres.
        chain: (K,) joints of the limb.
        kept: (N,) True for each bone that keeps its world rotation.
        rise: fraction of its rise above the goal that the foot keeps.
        sink: fraction of its sinking below the goal that the foot keeps.
        goals: (T, 3) target positions, metres.
        drops: (T,) lowering of the root, metres. A foot without contact is moved back to its position before
            the lowering.
        turns: (T, N, 4) world rotations, changed in place.
        joints: (T, N, 3) metres, changed in place.
    """
    local = np.empty((len(parents), 4))
    for t in range(len(weights)):
        if weights[t] <= 0.0 and drops[t] <= 0.0:
            continue
        start, bend, end = chain[0], chain[middle], chain[-1]
        at = row(joints[t], end)
        w, free = weights[t], at[1] + drops[t]
        above = free - goals[t, 1]
        high = goals[t, 1] + rise * max(above, 0.0) + sink * min(above, 0.0)
        goal = (
            at[0] + w * (goals[t, 0] - at[0]),
            free + w * (high - free),
            at[2] + w * (goals[t, 2] - at[2]),
        )
        bulge = turn(load(turns[t], chain[1]), side[0], side[1], side[2])
        upper, lower = two_bone(row(joints[t], start), row(joints[t], bend), at, goal, bulge)
        fixed = kept.copy()
        local_turns(parents, turns[t], local)
        for i in range(1, len(chain)):
            q = upper if i <= middle else lower
            store(turns[t], chain[i], mul(q, load(turns[t], chain[i])))
            fixed[chain[i]] = True
        rebuild(parents, vectors[min(t, len(vectors) - 1)], fixed, local, start, turns[t], joints[t])


@njit(cache=True, nogil=True)
def local_turns(parents, turns, local):
    """Computes ``local`` (N, 4), the rotation of each bone relative to its parent bone."""
    for j in range(len(parents)):
        q = load(turns, j)
        store(local, j, q if parents[j] < 0 else mul(conj(load(turns, parents[j])), q))


@njit(cache=True, nogil=True)
def rebuild(parents, vectors, fixed, local, first, turns, joints):
    """Recomputes the rotations of bones that are not ``fixed`` (N,) from their parents, and all joints
    after ``first``.
    """
    for j in range(first + 1, len(parents)):
        if not fixed[j]:
            store(turns, j, mul(load(turns, parents[j]), load(local, j)))
        x, y, z = turn(load(turns, j), vectors[j, 0], vectors[j, 1], vectors[j, 2])
        joints[j, 0] = joints[parents[j], 0] + x
        joints[j, 1] = joints[parents[j], 1] + y
        joints[j, 2] = joints[parents[j], 2] + z
