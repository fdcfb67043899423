"""From joints that turn about themselves (glTF, FBX, BVH) to bones that turn about their upper end.

A joint of such a rig turns, about its own place, all the links to its children, and the vertices that follow
it. Here a *bone* is one link, and turns about the joint it begins at. So:

- the links from joint j to its children are bones that turn as j does;
- vertices of joint j follow a bone that begins at j and goes on straight from the bone that comes in (of a
  chest: the neck, not a shoulder); of several that do, the one that carries the most. Where none does, the
  vertices get a bone of their own, so that no ear takes the head along. Vertices of the root (a pelvis)
  follow the turn of the whole, for the same reason;
- a joint without children gets a *tip*: where the rig has a leaf node below it (as Blender's exporter
  writes), else at the far end of the vertices that it moves;
- joints at one place are one joint: a rig needs one for each limb that turns on its own, here each bone does;
- joints that neither move a vertex nor carry one that does are dropped (pole targets, controllers), and so is
  a root that moves nothing and carries one joint only;
- a link that does not hold is cut, and what is cut off hung elsewhere: see ``rig_links``.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from enliven.arrays import Float
from enliven.document import Skeleton, stretched, unused
from enliven.formats.rig.rig_links import LinkBody, downward, links_of
from enliven.rotation import conjugate, rotate, stretch_from_strain

_SAME_PLACE = 2e-5
"""Maximum distance of two joints that count as one place, as a fraction of the size. It covers rounding
errors of files."""
_MIN_TRACK_MOTION_FRACTION = 1e-4
"""Minimum motion of a joint relative to its parent to keep the joint's track, as a fraction of the size. Less
is a rounding error."""
_MAX_STRAY_SURFACE_FRACTION = 0.01
"""Maximum fraction of the surface that follows a body only by stray weights. Such a body is drawn with the
root."""
_SAME_PLACE_FRACTION = 1e-3
"""Maximum distance over time of joints of one place that still count as one, as a fraction of the size. Less
is not visible."""
_STRAIGHT_BONE_COSINE = np.cos(np.radians(25.0))
"""Cosine of 25 degrees: bones within that angle of the incoming bone count as equally straight."""
_MAX_PAIR_DIFFERENCE = 0.02
"""Maximum difference between two bones of a fork that count as a pair. It bounds the relative difference of
their lengths, and the difference of the cosines of their bends. Such a pair can be two shoulders, so
neither of them is the neck."""
_MAX_STUB_LENGTH_RATIO = 0.4
"""Length of a forking joint's own bone, in lengths of the bone that comes in: too short for a limb."""


@dataclass
class Tree:
    """A skeleton made of a rig.

    Attributes:
        skeleton: joints and tips.
        driver: for each bone the body that it turns with.
        body: for each joint the body that it is the place of, -1 for a tip.
        bone: for each body that vertices follow, the bone that they follow now.
        root: the body that the root joint is at.
        notes: what was changed, a sentence each.
    """

    skeleton: Skeleton
    driver: list[int]
    body: list[int]
    bone: dict[int, int]
    root: int
    notes: list[str]


def tree_of(bodies: list[LinkBody], size: float, as_is: bool = False) -> Tree:
    """Returns the skeleton of a rig.

    Args:
        bodies: parents before children, one at least moves vertices.
        size: metres, of the whole model.
        as_is: believe the file's parents: a file of ours has been through this before.
    """
    links = links_of(bodies, size, as_is)
    places = _joined_bodies(bodies, links.parents, size)
    apart = [j for j in links.merged if _parts_from_root(bodies, j, links.root, size)]
    tree = _build_skeleton(bodies, links.parents, places, size, links.notes, apart)
    tree.bone.update(dict.fromkeys((j for j in links.merged if j not in apart), 0))
    return tree


def _parts_from_root(bodies: list[LinkBody], j: int, root: int, size: float) -> bool:
    """Whether a body above the root moves against it with more of the surface than stray weights."""
    if bodies[j].mass <= _MAX_STRAY_SURFACE_FRACTION * sum(body.mass for body in bodies):
        return False
    expected = bodies[root].places + bodies[root].moved(bodies[j].rest - bodies[root].rest)
    away = np.linalg.norm(expected - bodies[j].places, axis=1).max(initial=0.0)
    turned = np.abs(np.sum(bodies[root].turns * bodies[j].turns, axis=1)).min(initial=1.0)
    return bool(away > _SAME_PLACE_FRACTION * size or turned < 1.0 - _SAME_PLACE_FRACTION**2)


def joint_drift(bodies: list[LinkBody], tree: Tree) -> list[tuple[str, float]]:
    """Returns each joint that leaves the bone that its vertices follow, and by how many metres."""
    skeleton, drifts, tracks = tree.skeleton, [], joint_tracks(bodies, tree)
    for number, bone in tree.bone.items():
        body, start = bodies[number], max(int(skeleton.parents[bone]), 0)
        lever = body.rest - skeleton.positions[start]
        expected = tracks[:, start] + bodies[tree.driver[bone]].moved(lever)
        away = np.linalg.norm(expected - body.places, axis=1).max(initial=0.0)
        drifts.append((body.name, float(away)))
    return drifts


def joint_tracks(bodies: list[LinkBody], tree: Tree) -> Float:
    """(F, N, 3) metres, the joints over time: where their bodies are, and tips where they are carried to."""
    skeleton = tree.skeleton
    at = np.empty((len(bodies[0].places), len(skeleton), 3))
    for j, body in enumerate(tree.body):
        if body >= 0:
            at[:, j] = bodies[body].places
        else:
            at[:, j] = at[:, skeleton.parents[j]] + bodies[tree.driver[j]].moved(skeleton.vectors[j])
    return at


def clip_tracks(bodies: list[LinkBody], tree: Tree, size: float) -> tuple[Float | None, Float | None]:
    """(F, N, 3) offsets and (F, N, 6) strains of the bones, as a clip has them; None where none is seen."""
    skeleton, at = tree.skeleton, joint_tracks(bodies, tree)
    offsets, strains = np.zeros_like(at), np.zeros((*at.shape[:2], 6))
    for j in range(len(skeleton)):
        driver = bodies[tree.driver[j]]
        if driver.strains is not None:
            strains[:, j] = driver.strains
        if j and tree.body[j] >= 0:
            way = rotate(conjugate(driver.turns), at[:, j] - at[:, skeleton.parents[j]])
            way = way if driver.mirrors is None else way * driver.mirrors[:, None]
            offsets[:, j] = stretched(stretch_from_strain(-strains[:, j]), way) - skeleton.vectors[j]
    offsets[:, np.abs(offsets).max((0, 2), initial=0.0) <= _MIN_TRACK_MOTION_FRACTION * size] = 0.0
    return offsets if offsets.any() else None, strains if strains.any() else None


def _joined_bodies(bodies: list[LinkBody], parents: dict[int, int], size: float) -> dict[int, int]:
    """Returns for each body the first body at its place that is beside or above it in the tree."""
    first: dict[int, int] = {}
    for j in downward(parents):
        if parents[j] < 0:
            first[j] = j
            continue
        home = first[parents[j]]
        beside = [k for k in first if parents[k] >= 0 and first.get(parents[k]) == home and first[k] == k]
        near = [k for k in (home, *beside) if _is_same_place(bodies, j, k, size)]
        first[j] = near[0] if near else j
    return first


def _is_same_place(bodies: list[LinkBody], a: int, b: int, size: float) -> bool:
    """Whether two bodies are at one place, at rest and always."""
    if np.linalg.norm(bodies[a].rest - bodies[b].rest) > _SAME_PLACE * size:
        return False
    away = np.linalg.norm(bodies[a].places - bodies[b].places, axis=1)
    return bool(away.max(initial=0.0) <= _SAME_PLACE_FRACTION * size)


def _build_skeleton(
    bodies: list[LinkBody],
    parents: dict[int, int],
    first: dict[int, int],
    size: float,
    notes: list[str],
    apart: list[int],
) -> Tree:
    """The skeleton: one joint for each place, one bone for each link, and the tips.

    ``apart`` are bodies above the root that do not go with it, and get a limb of their own there.
    """
    names: dict[int, str] = {}
    for j, home in first.items():
        names[home] = min(names.get(home, bodies[j].name), bodies[j].name, key=len)
    joints = _Joints(size)
    number: dict[int, int] = {}
    for j in downward(parents):
        if first[j] != j:
            continue
        above = -1 if parents[j] < 0 else number[first[parents[j]]]
        number[j] = joints.add(names[j], above, bodies[j].rest, parents[j] if above >= 0 else j, j)
    root = next(j for j in parents if parents[j] < 0)
    bone: dict[int, int] = {}
    for j in downward(parents):
        home = number[first[j]]
        if j == root and len(joints.names) > 1:
            bone[j] = 0
            continue
        out = [k for k in range(1, len(joints.names)) if joints.drivers[k] == j and joints.parents[k] == home]
        if bodies[j].mass > 0 and not out:
            name, place = _bone_tip(bodies, j, joints, home, size)
            bone[j] = joints.add(name, home, place, j)
        elif out:
            onward = joints.straightest(home, out)
            if onward < 0 and bodies[j].mass > 0:
                onward = joints.add(
                    f"{bodies[j].name} end", home, joints.beyond(home, _MAX_STUB_LENGTH_RATIO), j
                )
            bone[j] = max(onward, out[0])
    for j in apart:
        home = joints.add(bodies[j].name, 0, bodies[j].rest, root, j)
        bone[j] = joints.add(f"{bodies[j].name} end", home, joints.beyond(home, 0.5), j)
    return Tree(*joints.sorted(bone), root=root, notes=notes)


class _Joints:
    """The joints that have been made so far."""

    def __init__(self, size: float) -> None:
        self.names: list[str] = []
        self.parents: list[int] = []
        self.rest: list[Float] = []
        self.drivers: list[int] = []
        self.bodies: list[int] = []
        self._size = size

    def add(self, name: str, parent: int, rest: Float, driver: int, body: int = -1) -> int:
        """The number of a new joint, the place of a body or a tip; a name that is taken gets a number."""
        self.names.append(unused(name, self.names))
        self.parents.append(parent)
        self.rest.append(np.asarray(rest, np.float64))
        self.drivers.append(driver)
        self.bodies.append(body)
        return len(self.names) - 1

    def straightest(self, home: int, bones: list[int]) -> int:
        """Returns the bone that goes on from ``home``, of those that begin there; -1 where all turn off."""
        if len(bones) == 1:
            return bones[0]
        into = self.rest[home] - self.rest[max(self.parents[home], 0)]
        ways = {k: self.rest[k] - self.rest[home] for k in bones}
        bends = {k: _cosine_between(into, way) for k, way in ways.items()}
        lengths = {k: float(np.linalg.norm(way)) for k, way in ways.items()}

        def paired(k: int) -> bool:
            alike = [i for i in bones if i != k and abs(bends[i] - bends[k]) < _MAX_PAIR_DIFFERENCE]
            return any(abs(lengths[i] - lengths[k]) < _MAX_PAIR_DIFFERENCE * lengths[k] for i in alike)

        onward = [k for k in bones if bends[k] >= _STRAIGHT_BONE_COSINE and not paired(k)]
        return max(onward, key=lambda k: (self._descendant_count(k), -k), default=-1)

    def beyond(self, home: int, share: float) -> Float:
        """Returns (3,) metres: the point beyond a joint by a share of the bone that comes in."""
        into = self.rest[home] - self.rest[max(self.parents[home], 0)]
        length = float(np.linalg.norm(into))
        return self.rest[home] + (share * into if length > 1e-3 * self._size else [0.0, 0.05 * self._size, 0])

    def _descendant_count(self, joint: int) -> int:
        """How many joints hang on one."""
        inside = {joint}
        for k in range(joint + 1, len(self.names)):
            if self.parents[k] in inside:
                inside.add(k)
        return len(inside)

    def sorted(self, bone: dict[int, int]) -> tuple[Skeleton, list[int], list[int], dict[int, int]]:
        """Returns a skeleton, a branch at a time, with drivers, bodies and bones by its numbers."""
        order = downward(dict(enumerate(self.parents)))
        new = {old: k for k, old in enumerate(order)}
        above = [-1 if self.parents[old] < 0 else new[self.parents[old]] for old in order]
        names = tuple(self.names[old] for old in order)
        skeleton = Skeleton(names, np.array(above, np.int32), np.array([self.rest[old] for old in order]))
        drivers, bodies = ([some[old] for old in order] for some in (self.drivers, self.bodies))
        return skeleton, drivers, bodies, {j: new[k] for j, k in bone.items()}


def _bone_tip(bodies: list[LinkBody], j: int, joints: _Joints, home: int, size: float) -> tuple[str, Float]:
    """Returns the name and the place of the end of the bone of a joint without children."""
    body = bodies[j]
    for name, place in body.leaves:
        if np.linalg.norm(place - body.rest) > 1e-3 * size:
            return name, place
    name = f"{body.name} end"
    if body.reach is not None and np.linalg.norm(body.reach - body.rest) > 1e-3 * size:
        return name, body.reach
    return name, joints.beyond(home, 0.5)


def _cosine_between(a: Float, b: Float) -> float:
    return float(a @ b / max(float(np.linalg.norm(a) * np.linalg.norm(b)), 1e-12))
