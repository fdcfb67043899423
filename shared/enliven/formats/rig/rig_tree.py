"""Converts joints that rotate about themselves (glTF, FBX, BVH) to bones that rotate about their upper end.

A joint of such a rig rotates the links to all of its children, and its vertices, about its own position. Here
a *bone* is a single link, and rotates about the joint at which it begins. The rules of the conversion:

- The links from joint j to its children are bones with the rotation of j.
- Vertices of joint j follow a bone that begins at j and continues the bone that ends at j in a straight line.
  For a chest, this is the neck and not a shoulder. If several bones do, the bone with the most descendants is
  used. If none does, the vertices get a separate bone, so that an ear does not move the head. For the same
  reason, vertices of the root (a pelvis) follow the rotation of the whole skeleton.
- A joint without children gets a *tip*. If the rig has a leaf node below the joint, as Blender's exporter
writes, the end is at this node. Otherwise, it is at the far end of the joint's vertices.
- Joints at the same position become one joint. A rig needs one joint for each limb that rotates separately,
  but here each bone rotates separately.
- Joints are removed if neither they nor their descendants have vertices, such as pole targets and
  controllers. A root that moves no vertex and has a single child is also removed.
- A link is cut if the animations contradict it, and the cut branch gets another parent, see ``rig_links``.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from enliven.arrays import Float
from enliven.document import Skeleton, apply_stretch, unused
from enliven.formats.rig.rig_links import LinkBody, depth_first_order, find_links
from enliven.rotation import conjugate, rotate, stretch_from_strain

_MAX_REST_DISTANCE_FRACTION = 2e-5
"""Maximum distance between two joints at the same position, as a fraction of the size. It allows for rounding
errors in files."""
_MIN_TRACK_MOTION_FRACTION = 1e-4
"""Minimum motion of a joint relative to its parent at which its track is kept, as a fraction of the size.
Less motion is a rounding error."""
_MAX_STRAY_SURFACE_FRACTION = 0.01
"""Maximum fraction of the surface that follows a body because of stray skin weights. The vertices of such a
body follow the root."""
_MAX_MOVING_DISTANCE_FRACTION = 1e-3
"""Maximum distance over time between two joints that are merged, as a fraction of the size. A smaller
distance is not visible."""
_STRAIGHT_BONE_COSINE = np.cos(np.radians(25.0))
"""Cosine of 25 degrees. Bones within this angle of the incoming bone count as equally straight."""
_MAX_PAIR_DIFFERENCE = 0.02
"""Maximum difference between two bones of a pair at a branching joint. It limits the relative difference of
their lengths, and the difference of the cosines of their bends. The bones of a pair may be shoulders, so
neither of them counts as the neck."""
_MAX_STUB_LENGTH_RATIO = 0.4
"""Length of the separate bone for the vertices of a branching joint, relative to the bone that ends at the
joint. It is shorter than a limb."""


@dataclass
class Tree:
    """A skeleton that was converted from a rig.

    Attributes:
        skeleton: the joints, including tips.
        driver: for each bone, the body that rotates it.
        body: for each joint, the body at its position, or -1 for a tip.
        bone: for each body with vertices, the bone that its vertices follow.
        root: the body at the position of the root joint.
        notes: a sentence for each change.
    """

    skeleton: Skeleton
    driver: list[int]
    body: list[int]
    bone: dict[int, int]
    root: int
    notes: list[str]


def build_tree(bodies: list[LinkBody], size: float, as_is: bool = False) -> Tree:
    """Returns the skeleton of a rig.

    Args:
        bodies: the joints, parents before children. At least one of them moves vertices.
        size: size of the whole model in metres.
        as_is: True keeps the file's parents. It is used for files that enliven itself wrote.
    """
    links = find_links(bodies, size, as_is)
    joint_bodies = _bodies_by_position(bodies, links.parents, size)
    separate_bodies = [j for j in links.merged if _moves_from_root(bodies, j, links.root, size)]
    tree = _build_skeleton(bodies, links.parents, joint_bodies, size, links.notes, separate_bodies)
    tree.bone.update(dict.fromkeys((j for j in links.merged if j not in separate_bodies), 0))
    return tree


def _moves_from_root(bodies: list[LinkBody], j: int, root: int, size: float) -> bool:
    """Returns True if a body above the root moves relative to the root, and moves more surface than stray
    weights would."""
    if bodies[j].mass <= _MAX_STRAY_SURFACE_FRACTION * sum(body.mass for body in bodies):
        return False
    expected = bodies[root].places + bodies[root].transform_vectors(bodies[j].rest - bodies[root].rest)
    distances = np.linalg.norm(expected - bodies[j].places, axis=1).max(initial=0.0)
    cosine = np.abs(np.sum(bodies[root].turns * bodies[j].turns, axis=1)).min(initial=1.0)
    return bool(
        distances > _MAX_MOVING_DISTANCE_FRACTION * size or cosine < 1.0 - _MAX_MOVING_DISTANCE_FRACTION**2
    )


def joint_drift(bodies: list[LinkBody], tree: Tree) -> list[tuple[str, float]]:
    """Returns the name of each joint with vertices, and its maximum distance, metres, from the end of its
    bone.
    """
    skeleton, drifts, tracks = tree.skeleton, [], joint_tracks(bodies, tree)
    for number, bone in tree.bone.items():
        body, start = bodies[number], max(int(skeleton.parents[bone]), 0)
        lever = body.rest - skeleton.positions[start]
        expected = tracks[:, start] + bodies[tree.driver[bone]].transform_vectors(lever)
        distances = np.linalg.norm(expected - body.places, axis=1).max(initial=0.0)
        drifts.append((body.name, float(distances)))
    return drifts


def joint_tracks(bodies: list[LinkBody], tree: Tree) -> Float:
    """Returns the positions (F, N, 3) of the joints over time, metres. A tip moves rigidly with its bone."""
    skeleton = tree.skeleton
    positions = np.empty((len(bodies[0].places), len(skeleton), 3))
    for j, body in enumerate(tree.body):
        if body >= 0:
            positions[:, j] = bodies[body].places
        else:
            positions[:, j] = positions[:, skeleton.parents[j]] + bodies[tree.driver[j]].transform_vectors(
                skeleton.vectors[j]
            )
    return positions


def clip_tracks(bodies: list[LinkBody], tree: Tree, size: float) -> tuple[Float | None, Float | None]:
    """Returns (F, N, 3) offsets and (F, N, 6) strains of the bones, in the format of a clip. Each is None if
    it is zero or too small to be visible.
    """
    skeleton, positions = tree.skeleton, joint_tracks(bodies, tree)
    offsets, strains = np.zeros_like(positions), np.zeros((*positions.shape[:2], 6))
    for j in range(len(skeleton)):
        driver = bodies[tree.driver[j]]
        if driver.strains is not None:
            strains[:, j] = driver.strains
        if j and tree.body[j] >= 0:
            direction = rotate(conjugate(driver.turns), positions[:, j] - positions[:, skeleton.parents[j]])
            direction = direction if driver.mirrors is None else direction * driver.mirrors[:, None]
            offsets[:, j] = (
                apply_stretch(stretch_from_strain(-strains[:, j]), direction) - skeleton.vectors[j]
            )
    offsets[:, np.abs(offsets).max((0, 2), initial=0.0) <= _MIN_TRACK_MOTION_FRACTION * size] = 0.0
    return offsets if offsets.any() else None, strains if strains.any() else None


def _bodies_by_position(bodies: list[LinkBody], parents: dict[int, int], size: float) -> dict[int, int]:
    """Returns for each body the first body at the same position among its parent and siblings, or the body
    itself if there is none."""
    first_body: dict[int, int] = {}
    for j in depth_first_order(parents):
        if parents[j] < 0:
            first_body[j] = j
            continue
        joint_number = first_body[parents[j]]
        relatives = [
            k
            for k in first_body
            if parents[k] >= 0 and first_body.get(parents[k]) == joint_number and first_body[k] == k
        ]
        same_place = [k for k in (joint_number, *relatives) if _is_same_place(bodies, j, k, size)]
        first_body[j] = same_place[0] if same_place else j
    return first_body


def _is_same_place(bodies: list[LinkBody], a: int, b: int, size: float) -> bool:
    """Returns True if two bodies are at the same position at rest and in all frames."""
    if np.linalg.norm(bodies[a].rest - bodies[b].rest) > _MAX_REST_DISTANCE_FRACTION * size:
        return False
    distances = np.linalg.norm(bodies[a].places - bodies[b].places, axis=1)
    return bool(distances.max(initial=0.0) <= _MAX_MOVING_DISTANCE_FRACTION * size)


def _build_skeleton(
    bodies: list[LinkBody],
    parents: dict[int, int],
    first: dict[int, int],
    size: float,
    notes: list[str],
    apart: list[int],
) -> Tree:
    """Builds the skeleton: one joint for each position, one bone for each link, and the tips.

    ``apart`` contains bodies above the root that move relative to the root. Each gets a separate limb at the
    root.
    """
    names: dict[int, str] = {}
    for j, joint_number in first.items():
        names[joint_number] = min(names.get(joint_number, bodies[j].name), bodies[j].name, key=len)
    joints = _Joints(size)
    number: dict[int, int] = {}
    for j in depth_first_order(parents):
        if first[j] != j:
            continue
        parent_number = -1 if parents[j] < 0 else number[first[parents[j]]]
        number[j] = joints.add(
            names[j], parent_number, bodies[j].rest, parents[j] if parent_number >= 0 else j, j
        )
    root = next(j for j in parents if parents[j] < 0)
    bone: dict[int, int] = {}
    for j in depth_first_order(parents):
        joint_number = number[first[j]]
        if j == root and len(joints.names) > 1:
            bone[j] = 0
            continue
        out = [
            k
            for k in range(1, len(joints.names))
            if joints.drivers[k] == j and joints.parents[k] == joint_number
        ]
        if bodies[j].mass > 0 and not out:
            name, tip_position = _bone_tip(bodies, j, joints, joint_number, size)
            bone[j] = joints.add(name, joint_number, tip_position, j)
        elif out:
            straight = joints.find_straightest_bone(joint_number, out)
            if straight < 0 and bodies[j].mass > 0:
                straight = joints.add(
                    f"{bodies[j].name} end",
                    joint_number,
                    joints.point_beyond(joint_number, _MAX_STUB_LENGTH_RATIO),
                    j,
                )
            bone[j] = max(straight, out[0])
    for j in apart:
        joint_number = joints.add(bodies[j].name, 0, bodies[j].rest, root, j)
        bone[j] = joints.add(f"{bodies[j].name} end", joint_number, joints.point_beyond(joint_number, 0.5), j)
    return Tree(*joints.sort_depth_first(bone), root=root, notes=notes)


class _Joints:
    """The joints of a skeleton under construction."""

    def __init__(self, size: float) -> None:
        self.names: list[str] = []
        self.parents: list[int] = []
        self.rest: list[Float] = []
        self.drivers: list[int] = []
        self.bodies: list[int] = []
        self._size = size

    def add(self, name: str, parent: int, rest: Float, driver: int, body: int = -1) -> int:
        """Adds the joint of a body, or a tip, and returns its number. If the name is taken, a number is
        appended to it."""
        self.names.append(unused(name, self.names))
        self.parents.append(parent)
        self.rest.append(np.asarray(rest, np.float64))
        self.drivers.append(driver)
        self.bodies.append(body)
        return len(self.names) - 1

    def find_straightest_bone(self, joint_number: int, bones: list[int]) -> int:
        """Returns the bone among ``bones`` that continues the bone ending at a joint in a straight line, or
        -1 if there is none."""
        if len(bones) == 1:
            return bones[0]
        incoming = self.rest[joint_number] - self.rest[max(self.parents[joint_number], 0)]
        directions = {k: self.rest[k] - self.rest[joint_number] for k in bones}
        bends = {k: _cosine_between(incoming, direction) for k, direction in directions.items()}
        lengths = {k: float(np.linalg.norm(direction)) for k, direction in directions.items()}

        def paired(k: int) -> bool:
            similar = [i for i in bones if i != k and abs(bends[i] - bends[k]) < _MAX_PAIR_DIFFERENCE]
            return any(abs(lengths[i] - lengths[k]) < _MAX_PAIR_DIFFERENCE * lengths[k] for i in similar)

        straight = [k for k in bones if bends[k] >= _STRAIGHT_BONE_COSINE and not paired(k)]
        return max(straight, key=lambda k: (self._count_descendants(k), -k), default=-1)

    def point_beyond(self, joint_number: int, fraction: float) -> Float:
        """Returns a point (3,) beyond a joint, metres. Its distance from the joint is ``fraction`` of the
        length of the bone that ends at the joint.
        """
        incoming = self.rest[joint_number] - self.rest[max(self.parents[joint_number], 0)]
        length = float(np.linalg.norm(incoming))
        return self.rest[joint_number] + (
            fraction * incoming if length > 1e-3 * self._size else [0.0, 0.05 * self._size, 0]
        )

    def _count_descendants(self, joint: int) -> int:
        """Returns the number of joints in the subtree of a joint."""
        inside = {joint}
        for k in range(joint + 1, len(self.names)):
            if self.parents[k] in inside:
                inside.add(k)
        return len(inside)

    def sort_depth_first(self, bone: dict[int, int]) -> tuple[Skeleton, list[int], list[int], dict[int, int]]:
        """Returns the skeleton with joints in depth-first order, and the drivers, bodies and bones renumbered
        accordingly."""
        order = depth_first_order(dict(enumerate(self.parents)))
        new = {old: k for k, old in enumerate(order)}
        above = [-1 if self.parents[old] < 0 else new[self.parents[old]] for old in order]
        names = tuple(self.names[old] for old in order)
        skeleton = Skeleton(names, np.array(above, np.int32), np.array([self.rest[old] for old in order]))
        drivers, bodies = ([values[old] for old in order] for values in (self.drivers, self.bodies))
        return skeleton, drivers, bodies, {j: new[k] for j, k in bone.items()}


def _bone_tip(
    bodies: list[LinkBody], j: int, joints: _Joints, joint_number: int, size: float
) -> tuple[str, Float]:
    """Returns the name and position of the tip of a joint without children."""
    body = bodies[j]
    for name, leaf_position in body.leaves:
        if np.linalg.norm(leaf_position - body.rest) > 1e-3 * size:
            return name, leaf_position
    name = f"{body.name} end"
    if body.reach is not None and np.linalg.norm(body.reach - body.rest) > 1e-3 * size:
        return name, body.reach
    return name, joints.point_beyond(joint_number, 0.5)


def _cosine_between(a: Float, b: Float) -> float:
    return float(a @ b / max(float(np.linalg.norm(a) * np.linalg.norm(b)), 1e-12))
