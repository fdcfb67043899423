"""Determines the parent of each joint of a rig. It is the file's parent, unless the animations contradict it.

Animators' files contain controllers. For example, a foot driven by inverse kinematics is a child of a
controller on the ground, and its animation keeps it at the end of the shin. In a skeleton with bones that
only rotate, the foot must be a child of the shin. So a link to a parent is cut if the joint does not keep its
position relative to the parent in the animations. The cut branch is attached to the joint that it follows
best.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from enliven.arrays import Float
from enliven.document import apply_stretch
from enliven.rotation import rotate, stretch_from_strain

_MIN_LOOSE_FRACTION = 0.01
"""Minimum deviation of a detached joint from its rest position relative to its parent, as a fraction of the
model's size."""
_MISFIT_PER_REST_DISTANCE = 0.5
"""Misfit, in metres, that costs as much as a metre of distance at rest. Because of this cost, the nearer of
two equally suitable parents is chosen."""
_MIN_MISFIT_RATIO = 3.0
"""Minimum ratio of the misfit of the file's parent to the misfit of a joint that replaces it. It is large,
because the parents in a file are usually right."""
_MIN_ROOT_SURFACE_FRACTION = 0.1
"""Minimum fraction of the surface that the branch of a root must carry. Branches with less surface are loose
parts, not the body."""
_COMPARED_FRAMES = 150
"""Total number of compared frames of all animations. It is enough to detect broken links. More frames would
be slow, because each frame costs quadratic time in the number of joints."""


@dataclass
class LinkBody:
    """A joint of a rig as a rigid body, with the vertices and leaf nodes that follow it.

    Attributes:
        name: name of the joint.
        parent: number of the parent body, or -1.
        rest: (3,) metres, the rest position.
        turns: (F, 4) world rotations relative to rest, for the frames of all animations in sequence.
        places: (F, 3) positions in these frames, metres.
        mass: area of the surface that follows the joint, m^2. Each vertex counts by its weight.
        reach: (3,) the far end of this surface, metres, or None.
        leaves: name and position (3,), metres, of each child node that is not a joint.
        strains: (F, 6) the Hencky strains relative to rest, applied before the rotations. None if it is never
            stretched.
        mirrors: (F,) -1 in frames in which it is mirrored relative to rest, and 1 in all others. None if it
            is never mirrored.
    """

    name: str
    parent: int
    rest: Float
    turns: Float
    places: Float
    mass: float = 0.0
    reach: Float | None = None
    leaves: list[tuple[str, Float]] = field(default_factory=list)
    strains: Float | None = None
    mirrors: Float | None = None

    def transform_vectors(self, vectors: Float) -> Float:
        """Transforms vectors (3,) or (F, 3) of the rest pose to each frame (F, 3). They are mirrored and
        stretched, and then rotated.
        """
        if self.mirrors is not None:
            vectors = self.mirrors[:, None] * vectors
        if self.strains is not None:
            vectors = apply_stretch(
                stretch_from_strain(self.strains), np.broadcast_to(vectors, (len(self.places), 3))
            )
        return rotate(self.turns, vectors)


@dataclass
class Links:
    """The tree of the joints.

    Attributes:
        parents: the parent of each remaining body, -1 for the root.
        merged: bodies that are ancestors of the root in the file. Their vertices follow the root.
        notes: a sentence for each change.
    """

    parents: dict[int, int]
    merged: tuple[int, ...]
    notes: list[str]

    @property
    def root(self) -> int:
        """The number of the root body."""
        return next(j for j, parent in self.parents.items() if parent < 0)


def find_links(bodies: list[LinkBody], size: float, as_is: bool = False) -> Links:
    """Determines the tree of the joints. The root is one of the topmost joints of the detached parts. The
    choice minimises the total misfit.

    Joints are removed if neither they nor their descendants move vertices. Their parents get a leaf at their
    positions. A root that moves no vertex and has a single child is removed too.

    Args:
        as_is: True to keep the file's parents, even if their links change in the animations.
    """
    file_parents = [body.parent for body in bodies]
    misfits = _compute_rest_misfits(bodies)
    loose_bodies = [
        p < 0 or (not as_is and misfits[j, p] > _MIN_LOOSE_FRACTION * size)
        for j, p in enumerate(file_parents)
    ]
    weight = _subtree_surfaces(bodies, file_parents)
    total = sum(body.mass for body in bodies)
    tops = [
        j for j in range(len(bodies)) if loose_bodies[j] and weight[j] > _MIN_ROOT_SURFACE_FRACTION * total
    ]
    if not tops:
        # If many sibling joints each move only a small part, as in a baked surface, use the joint that moves
        # most of the mesh as the root.
        tops = [max((j for j in range(len(bodies)) if loose_bodies[j]), key=lambda j: (weight[j], -j))]
    trees = [
        _attach_to_root(bodies, file_parents, loose_bodies, misfits, top)
        for top in sorted(tops, key=lambda j: (-weight[j], j))
    ]
    links = min(
        trees, key=lambda one: _mean_misfit(bodies, one, misfits) // (0.3 * _MIN_LOOSE_FRACTION * size)
    )
    moving_bodies = [
        f"{bodies[j].name} on {bodies[p].name}"
        for j, p in links.parents.items()
        if p not in (-1, file_parents[j])
    ]
    if moving_bodies:
        links.notes.append(f"joints were attached to the joints that they follow: {', '.join(moving_bodies)}")
    for j in set(range(len(bodies))) - set(links.parents):
        if file_parents[j] in links.parents:
            bodies[file_parents[j]].leaves.append((bodies[j].name, bodies[j].rest))
    _drop_controller_roots(bodies, links)
    return links


def depth_first_order(parents: dict[int, int]) -> list[int]:
    """Returns the bodies in depth-first order, each after its parent."""
    children: dict[int, list[int]] = {}
    for j, parent in parents.items():
        children.setdefault(parent, []).append(j)
    order, remaining = [], list(reversed(children.get(-1, [])))
    while remaining:
        order.append(remaining.pop())
        remaining.extend(reversed(children.get(order[-1], [])))
    return order


def _compute_rest_misfits(bodies: list[LinkBody]) -> Float:
    """Returns the root mean square deviation (J, J), metres, of body j from its rest position relative to
    body p.
    """
    count, frames = len(bodies), len(bodies[0].places)
    compared = np.unique(np.linspace(0, max(frames - 1, 0), min(frames, _COMPARED_FRAMES)).astype(int))
    if frames == 0:
        return np.zeros((count, count))
    rest = np.stack([body.rest for body in bodies])
    places = np.stack([body.places[compared] for body in bodies])
    misfits = np.empty((count, count))
    for p, body in enumerate(bodies):
        vectors = (rest - rest[p])[:, None]
        if body.strains is not None:
            vectors = apply_stretch(stretch_from_strain(body.strains[compared]), vectors)
        if body.mirrors is not None:
            vectors = vectors * body.mirrors[compared, None]
        expected = places[p] + rotate(body.turns[compared], vectors)
        misfits[:, p] = np.sqrt(((expected - places) ** 2).sum(2).mean(1))
    return misfits


def _subtree_surfaces(bodies: list[LinkBody], parents: list[int]) -> list[float]:
    """Returns for each body the area of the surface that the body and its descendants move."""
    weight = [body.mass for body in bodies]
    for j in range(len(bodies) - 1, -1, -1):
        if parents[j] >= 0:
            weight[parents[j]] += weight[j]
    return weight


def _attach_to_root(
    bodies: list[LinkBody], file_parents: list[int], loose: list[bool], misfits: Float, root: int
) -> Links:
    """Attaches all bodies that move vertices to ``root``, directly or through other bodies."""
    above = _file_ancestors(file_parents, root)
    parents = [-1 if loose[j] or j == root or p in above else p for j, p in enumerate(file_parents)]
    tops = [_find_root(parents, j) for j in range(len(bodies))]
    weight = {t: sum(b.mass for b, top in zip(bodies, tops, strict=True) if top == t) for t in tops}
    inside = {j for j in range(len(bodies)) if tops[j] == root}
    remaining = sorted((t for t in weight if t not in (root, *above)), key=lambda t: (-weight[t], t))
    while remaining:
        # Attach bodies first if their parent is already in the tree, because their own children may have to
        # be attached to them.
        t = next((t for t in remaining if file_parents[t] in inside), remaining[0])
        remaining.remove(t)
        parents[t] = _choose_new_parent(bodies, t, file_parents[t], inside, misfits)
        inside |= {j for j in range(len(bodies)) if tops[j] == t}
    kept_bodies = inside & _find_carrying_bodies(bodies, parents, inside)
    merged_bodies = tuple(j for j in above if bodies[j].mass > 0)
    return Links({j: parents[j] for j in sorted(kept_bodies | {root})}, merged_bodies, [])


def _file_ancestors(file_parents: list[int], j: int) -> list[int]:
    """Returns the ancestors of a body in the file."""
    chain = []
    while file_parents[j] >= 0:
        j = file_parents[j]
        chain.append(j)
    return chain


def _choose_new_parent(
    bodies: list[LinkBody], child: int, old_parent: int, inside: set[int], misfits: Float
) -> int:
    """Returns the body to which a cut branch is attached. It is the old parent, unless the branch follows
    another body much better.
    """
    costs = {
        c: misfits[child, c] + _MISFIT_PER_REST_DISTANCE * _compute_rest_distance(bodies, child, c)
        for c in inside
    }
    best_parent = min(costs, key=lambda c: (costs[c], c))
    return (
        old_parent
        if old_parent in inside
        and misfits[child, old_parent] < _MIN_MISFIT_RATIO * misfits[child, best_parent]
        else best_parent
    )


def _compute_rest_distance(bodies: list[LinkBody], child: int, parent: int) -> float:
    points = [bodies[parent].rest, *(leaf_position for _, leaf_position in bodies[parent].leaves)]
    return min(float(np.linalg.norm(bodies[child].rest - p)) for p in points)


def _find_root(parents: list[int], j: int) -> int:
    while parents[j] >= 0:
        j = parents[j]
    return j


def _find_carrying_bodies(bodies: list[LinkBody], parents: list[int], inside: set[int]) -> set[int]:
    """Returns the bodies that move vertices, and their ancestors."""
    carriers: set[int] = set()
    for j in inside:
        ancestor = j
        while bodies[j].mass > 0 and ancestor >= 0 and ancestor not in carriers:
            carriers.add(ancestor)
            ancestor = parents[ancestor]
    return carriers


def _mean_misfit(bodies: list[LinkBody], links: Links, misfits: Float) -> float:
    """Returns the mean distance in metres, over the surface, between the vertices and their true
    positions."""
    deviation = {j: 0.0 if p < 0 else float(misfits[j, p]) for j, p in links.parents.items()}
    for j in depth_first_order(links.parents):
        if links.parents[j] >= 0:
            deviation[j] += deviation[links.parents[j]]
    deviation.update({j: float(misfits[j, links.root]) for j in links.merged})
    return sum(bodies[j].mass * distance for j, distance in deviation.items()) / max(
        sum(b.mass for b in bodies), 1e-12
    )


def _drop_controller_roots(bodies: list[LinkBody], links: Links) -> None:
    """Removes roots that move no vertex and have a single child, such as a controller at the feet."""
    while True:
        root = links.root
        below = [j for j, parent in links.parents.items() if parent == root]
        if bodies[root].mass > 0 or len(below) != 1:
            return
        del links.parents[root]
        links.parents[below[0]] = -1
