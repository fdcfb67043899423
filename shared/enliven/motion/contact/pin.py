"""Feet that stay where they stand: contact by contact, the limb gives way by two-bone inverse kinematics.

    pin_feet(project, shape_id, joints, *, start=None, settings=ContactSettings()) -> Project
    unpin(project, shape_id, joints=None) -> Project
    held_pins(shape) -> list[HeldPin]                        # what the player works with

A limb of more than two bones is two rigid halves. The foot and its descendants keep their world turns, so a
sole that was flat stays flat. Where a stretched limb would not reach, the root comes down as far as it may,
evenly over time (Kovar, Schreiner & Gleicher, "Footskate cleanup for motion capture editing", 2002); a place
that is out of reach even so is met as nearly as can be.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from enliven.arrays import Bool, Float, Int32
from enliven.document import ContactSettings, Pin, Project, Shape, Skeleton
from enliven.errors import InputError
from enliven.kernels import njit
from enliven.motion.kinematics import conj, load, mul, row, store, turn, two_bone

_STRAIGHT = 1e-3
"""Share of its length below which the bulge of a limb at rest says nothing."""
_FRONT = np.array([0.0, 0.0, 1.0])
"""(3,) where knees go that rest straight, above a foot that does not say where its front is."""
_TOES = 0.05
"""Share of a limb's length that its foot leads ahead at least, to say where the front is."""


@dataclass(frozen=True, eq=False)
class HeldPin:
    """A pin with its joints found: chain[middle] bends, chain[-1] stays.

    Attributes:
        chain: (K,) int32 joints from the limb's start to the foot.
        middle: number in the chain of the joint that bends.
        side: (3,) to where it bulges at rest.
        size: metres, the limb's length.
        kept: (N,) which bones keep their turn in the world: those that begin at the foot.
        settings: when it is in contact.
        below: (B,) int32 the foot's joint and all that hangs on it.
        sole: metres that the lowest of these is above the sole of the mesh, at rest.
        ground: metres, the height of the floor that the shape stands on at rest, in its place.
        stance: metres that the foot's joint is above that floor, at rest.
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
    """A project in which these joints of a shape stay in their place while they are in contact.

    Args:
        joints: the feet (ankles, or toes with a ``start``), numbers or names.
        start: where the limb begins; None takes two bones.
        settings: when a foot is in contact; None for the usual.

    Raises:
        InputError: where a joint is not there or no limb of two bones ends in it.
    """
    shape = project.shape(shape_id)
    skeleton = shape.skeleton
    pins = {pin.joint: pin for pin in shape.pins}
    for joint in joints:
        foot = _number(skeleton, joint)
        hip = _two_up(skeleton, foot) if start is None else _number(skeleton, start)
        chain = skeleton.path(hip, foot) if hip >= 0 else ()
        if len(chain) < 3 or hip not in chain[:1] or min(chain) != hip:
            what = f"no limb of two bones ends in {skeleton.names[foot]!r}"
            raise InputError(what, where=f"shape {shape_id!r}", mend="Name the joint where the limb begins.")
        name = skeleton.names[foot]
        pins[name] = Pin(name, skeleton.names[hip], settings or ContactSettings())
    return project.with_characters(shape.with_changes(pins=tuple(pins.values())))


def unpin(project: Project, shape_id: str, joints: Sequence[int | str] | None = None) -> Project:
    """A project in which these joints (None: all) of a shape go free."""
    shape = project.shape(shape_id)
    names = None if joints is None else {shape.skeleton.names[_number(shape.skeleton, j)] for j in joints}
    kept = tuple(pin for pin in shape.pins if names is not None and pin.joint not in names)
    return project.with_characters(shape.with_changes(pins=kept))


def held_pins(shape: Shape) -> list[HeldPin]:
    """The pins of a shape that still has their limbs."""
    skeleton, made = shape.skeleton, []
    for pin in shape.pins:
        if pin.joint not in skeleton.names or pin.start not in skeleton.names:
            continue
        chain = skeleton.path(skeleton.index(pin.start), skeleton.index(pin.joint))
        if len(chain) < 3 or min(chain) != chain[0]:
            continue
        middle, side = bend_of(skeleton, chain)
        kept = skeleton.parents == chain[-1]
        size = float(skeleton.lengths[list(chain[1:])].sum())
        below = np.array([j for j in range(len(skeleton)) if chain[-1] in skeleton.path(0, j)], np.int32)
        ground = skeleton.positions[:, 1].min()
        if shape.mesh is not None:
            ground = min(ground, shape.mesh.vertices[:, 1].min())
        sole = float(skeleton.positions[below, 1].min() - ground)
        stance = float(skeleton.positions[chain[-1], 1] - ground)
        limb = (np.array(chain, np.int32), middle, side, size, kept)
        made.append(HeldPin(*limb, pin.settings, below, sole, float(ground + shape.place[1]), stance))
    return made


def bend_of(skeleton: Skeleton, chain: Sequence[int]) -> tuple[int, Float]:
    """Number in a chain of the joint nearest to its middle, and (3,) to where it bulges at rest."""
    at = skeleton.positions[list(chain)]
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(at, axis=0), axis=1))])
    middle = 1 + int(np.abs(along[1:-1] - along[-1] / 2).argmin())
    line = at[-1] - at[0]
    share = line @ (at[middle] - at[0]) / max(float(line @ line), 1e-300)
    side = at[middle] - at[0] - share * line
    straight = float(np.linalg.norm(side)) < _STRAIGHT * along[-1]
    return middle, _front(skeleton, chain[-1], line) if straight else np.asarray(side)


def _front(skeleton: Skeleton, foot: int, limb: Float) -> Float:
    """(3,) the way that a foot's toes point, across its limb (3,); ahead for a limb that ends in no foot."""
    ahead = [skeleton.vectors[toe] for toe in skeleton.children[foot]]
    length = max(float(np.linalg.norm(limb)), 1e-300)
    across = [way - (way @ limb) / length**2 * limb for way in ahead]
    longest = max(across, key=lambda way: float(np.linalg.norm(way)), default=_FRONT)
    return longest if np.linalg.norm(longest) > _TOES * length else _FRONT


def _number(skeleton: Skeleton, joint: int | str) -> int:
    if isinstance(joint, str):
        return skeleton.index(joint)
    if not 0 <= joint < len(skeleton):
        raise InputError(f"there is no joint {joint} among {len(skeleton)}", where="skeleton")
    return int(joint)


def _two_up(skeleton: Skeleton, joint: int) -> int:
    """The joint two bones above, or -1."""
    above = int(skeleton.parents[joint])
    return int(skeleton.parents[above]) if above >= 0 else -1


@njit(cache=True, nogil=True)
def pin_limb(parents, vectors, chain, middle, side, kept, rise, sink, weights, goals, drops, turns, joints):
    """Kernel: brings the end of a limb to its goal, as much as ``weights`` (T,) says, and rebuilds what hangs
    on it.

    Args:
        vectors: (T or 1, N, 3) metres from each parent to its joint before the bone turns.
        chain: (K,) joints of the limb.
        kept: (N,) bones that keep their turn in the world.
        rise: how much of its own rise above the goal the foot keeps.
        sink: how much of its own sinking below the goal.
        goals: (T, 3) metres.
        drops: (T,) metres that the whole has come down: a foot that is free goes where it went.
        turns: (T, N, 4) world turns, changed in place; joints: (T, N, 3) metres, too.
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
    """Kernel: ``local`` (N, 4) takes each bone's turn relative to its parent's."""
    for j in range(len(parents)):
        q = load(turns, j)
        store(local, j, q if parents[j] < 0 else mul(conj(load(turns, parents[j])), q))


@njit(cache=True, nogil=True)
def rebuild(parents, vectors, fixed, local, first, turns, joints):
    """Kernel: bones that are not ``fixed`` (N,) ride on their parents again, and all joints after ``first``
    are put where their bones lead."""
    for j in range(first + 1, len(parents)):
        if not fixed[j]:
            store(turns, j, mul(load(turns, parents[j]), load(local, j)))
        x, y, z = turn(load(turns, j), vectors[j, 0], vectors[j, 1], vectors[j, 2])
        joints[j, 0] = joints[parents[j], 0] + x
        joints[j, 1] = joints[parents[j], 1] + y
        joints[j, 2] = joints[parents[j], 2] + z
