"""From joints that turn about themselves (glTF, FBX, BVH) to bones that turn about their upper end.

A joint of such a rig turns, about its own place, all the links to its children, and the vertices that follow
it. Here a *bone* is one link, and turns about the joint it begins at. So:

- the links from joint j to its children are bones that turn as j does;
- vertices of joint j follow a bone that begins at j: the one that goes on most nearly straight from the bone
  that comes in (of a chest: the neck rather than a shoulder), and of those within 25 degrees of it the one
  that carries the most; any of them is right for the rig's own motion. Vertices of the root (a pelvis) follow
  the turn of the whole, so that no single limb takes the pelvis along;
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
from enliven.document import Skeleton, unused
from enliven.formats.rig.rig_links import LinkBody, downward, links_of
from enliven.rotation import rotate

_SAME_PLACE = 2e-5
"""Share of the size within which two joints are at one place: less is rounding."""
_STRAIGHT = np.cos(np.radians(25.0))
"""Cosine of 25 degrees: bones within that angle of the incoming bone count as equally straight."""


@dataclass
class Tree:
    """A skeleton made of a rig.

    Attributes:
        skeleton: joints and tips.
        driver: for each bone the body that it turns with.
        bone: for each body that vertices follow, the bone that they follow now.
        root: the body that the root joint is at.
        notes: what was changed, a sentence each.
    """

    skeleton: Skeleton
    driver: list[int]
    bone: dict[int, int]
    root: int
    notes: list[str]


def tree_of(bodies: list[LinkBody], size: float) -> Tree:
    """Returns the skeleton of a rig.

    Args:
        bodies: parents before children, one at least moves vertices.
        size: metres, of the whole model.
    """
    links = links_of(bodies, size)
    places = _joined(bodies, links.parents, size)
    tree = _built(bodies, links.parents, places, size, links.notes)
    tree.bone.update(dict.fromkeys(links.merged, 0))
    return tree


def joint_drift(bodies: list[LinkBody], tree: Tree) -> list[tuple[str, float]]:
    """Returns each joint that leaves its place on its parent, and by how many metres: bones cannot follow
    it."""
    skeleton, found = tree.skeleton, []
    at = np.empty((len(bodies[0].places), len(skeleton), 3))
    at[:, 0] = bodies[tree.root].places
    for j in range(1, len(skeleton)):
        turned = rotate(bodies[tree.driver[j]].turns, skeleton.vectors[j])
        at[:, j] = at[:, skeleton.parents[j]] + turned
    for number, bone in tree.bone.items():
        body, start = bodies[number], max(int(skeleton.parents[bone]), 0)
        lever = body.rest - skeleton.positions[start]
        expected = at[:, start] + rotate(bodies[tree.driver[bone]].turns, lever)
        away = np.linalg.norm(expected - body.places, axis=1).max(initial=0.0)
        found.append((body.name, float(away)))
    return found


def _joined(bodies: list[LinkBody], parents: dict[int, int], size: float) -> dict[int, int]:
    """Returns for each body the first body at its place that is beside or above it in the tree."""
    first: dict[int, int] = {}
    for j in downward(parents):
        if parents[j] < 0:
            first[j] = j
            continue
        home = first[parents[j]]
        beside = [k for k in first if parents[k] >= 0 and first.get(parents[k]) == home and first[k] == k]
        near = [k for k in (home, *beside) if _apart(bodies, j, k) <= _SAME_PLACE * size]
        first[j] = near[0] if near else j
    return first


def _apart(bodies: list[LinkBody], a: int, b: int) -> float:
    return float(np.linalg.norm(bodies[a].rest - bodies[b].rest))


def _built(
    bodies: list[LinkBody], parents: dict[int, int], first: dict[int, int], size: float, notes: list[str]
) -> Tree:
    """The skeleton: one joint for each place, one bone for each link, and the tips."""
    names: dict[int, str] = {}
    for j, home in first.items():
        names[home] = min(names.get(home, bodies[j].name), bodies[j].name, key=len)
    joints = _Joints(size)
    number: dict[int, int] = {}
    for j in downward(parents):
        if first[j] != j:
            continue
        above = -1 if parents[j] < 0 else number[first[parents[j]]]
        number[j] = joints.add(names[j], above, bodies[j].rest, parents[j] if above >= 0 else j)
    root = next(j for j in parents if parents[j] < 0)
    bone: dict[int, int] = {}
    for j in downward(parents):
        home = number[first[j]]
        if j == root and len(joints.names) > 1:
            bone[j] = 0
            continue
        out = [k for k in range(1, len(joints.names)) if joints.drivers[k] == j and joints.parents[k] == home]
        if not out and bodies[j].mass > 0:
            name, place = _tip(bodies, j, joints, home, size)
            out = [joints.add(name, home, place, j)]
        if out:
            bone[j] = joints.straightest(home, out)
    return Tree(*joints.sorted(bone), root=root, notes=notes)


class _Joints:
    """The joints that have been made so far."""

    def __init__(self, size: float) -> None:
        self.names: list[str] = []
        self.parents: list[int] = []
        self.rest: list[Float] = []
        self.drivers: list[int] = []
        self._size = size

    def add(self, name: str, parent: int, rest: Float, driver: int) -> int:
        """The number of a new joint; a name that is taken gets a number."""
        self.names.append(unused(name, self.names))
        self.parents.append(parent)
        self.rest.append(np.asarray(rest, np.float64))
        self.drivers.append(driver)
        return len(self.names) - 1

    def straightest(self, home: int, bones: list[int]) -> int:
        """Of the bones that begin at ``home``, the one that its vertices follow."""
        into = self.rest[home] - self.rest[max(self.parents[home], 0)]
        bends = {k: _cosine(into, self.rest[k] - self.rest[home]) for k in bones}
        best = max(bends.values())
        alike = [k for k in bones if bends[k] >= min(best, _STRAIGHT)]
        return max(alike, key=lambda k: (self._below(k), -k))

    def _below(self, joint: int) -> int:
        """How many joints hang on one."""
        inside = {joint}
        for k in range(joint + 1, len(self.names)):
            if self.parents[k] in inside:
                inside.add(k)
        return len(inside)

    def sorted(self, bone: dict[int, int]) -> tuple[Skeleton, list[int], dict[int, int]]:
        """Returns a skeleton, a branch at a time, with drivers and bones by its numbers."""
        order = downward(dict(enumerate(self.parents)))
        new = {old: k for k, old in enumerate(order)}
        above = [-1 if self.parents[old] < 0 else new[self.parents[old]] for old in order]
        names = tuple(self.names[old] for old in order)
        skeleton = Skeleton(names, np.array(above, np.int32), np.array([self.rest[old] for old in order]))
        return skeleton, [self.drivers[old] for old in order], {j: new[k] for j, k in bone.items()}


def _tip(bodies: list[LinkBody], j: int, joints: _Joints, home: int, size: float) -> tuple[str, Float]:
    """Returns the name and the place of the end of the bone of a joint without children."""
    body = bodies[j]
    for name, place in body.leaves:
        if np.linalg.norm(place - body.rest) > 1e-3 * size:
            return name, place
    name = f"{body.name} end"
    if body.reach is not None and np.linalg.norm(body.reach - body.rest) > 1e-3 * size:
        return name, body.reach
    into = joints.rest[home] - joints.rest[max(joints.parents[home], 0)]
    length = float(np.linalg.norm(into))
    onward = into / 2 if length > 1e-3 * size else np.array([0.0, 0.05 * size, 0.0])
    return name, np.asarray(body.rest + onward)


def _cosine(a: Float, b: Float) -> float:
    return float(a @ b / max(float(np.linalg.norm(a) * np.linalg.norm(b)), 1e-12))
