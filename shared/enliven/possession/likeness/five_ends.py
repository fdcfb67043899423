"""Identifies the head, the hands and the feet among the limb ends of a human-like mesh.

Geodesic distances along the surface hardly change with the pose. In a body they approximate distances in a
tree: arms and head branch at the chest, legs branch at the pelvis, and both limbs of a pair have equal
length. Every choice of a head and two pairs is tried, as Pinocchio tries embeddings (I. Baran and J. Popović,
2007). The cost of a choice has four terms: the deviation of its distances from the nearest such tree, unusual
proportions, limbs that are left out, and an unlikely stance.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from enliven.arrays import Float, Int
from enliven.deformation.graph.surface_ends import LimbEnds
from enliven.possession.likeness.tree_of_limbs import HEAD, LimbTree, point_at_distances, tree_misfit
from enliven.rotation import unit

_SAME_LIMB_DISTANCE = 0.12
"""Maximum distance between two ends of the same limb, such as fingers, toes or horns, as a fraction of the
longest geodesic distance."""
_EAR_DISTANCE = 0.8
"""Maximum distance between two ends that may be ears or horns, as a fraction of the longest geodesic
distance. The head is then between them."""
_OMITTED_LIMB_COST = 60.0
"""Cost of a limb that belongs to no chosen end. It is multiplied by the limb's length divided by the longest
geodesic distance."""
_OWN_END_DISTANCE = 0.15
"""Other ends within this distance of a chosen end, as a fraction of the longest geodesic distance, belong to
the same limb."""
_OMITTED_LEG_COST = 25.0
"""Cost of a limb that is left out although it stands on the floor, such as the additional legs of a chair or
a horse."""
_MIN_LEG_LENGTH = 0.08
"""Minimum length of a limb that counts as a leg, as a fraction of the longest geodesic distance."""
_MAX_LENGTH_FOR_COST = 0.3
"""The cost of a limb that is left out grows with its length up to this fraction of the longest geodesic
distance."""
_MIN_UPPER_HEIGHT = 0.4
"""Minimum height of head and hands above the feet, as a fraction of body height, if a body stands or sits."""
_LOW_COST = 60.0
"""Cost of head or hands below the minimum height, per body height of the difference."""
_RAISED_HANDS_COST = 8.0
"""Cost if both hands are above the head. Ends above the head are more likely ears or horns."""
_MAX_FOOT_HEIGHT = 0.15
"""Maximum height of feet without a cost, as a fraction of body height."""
_HIGH_FOOT_COST = 60.0
"""Cost of a foot above :data:`_MAX_FOOT_HEIGHT`, per body height of the difference."""
_TILTED_HEAD_COST = 4.0
"""Cost of a head at a right angle to the trunk."""
_TILTED_TRUNK_COST = 6.0
"""Cost of a trunk at a right angle to the vertical."""
_EVALUATED_CHOICES = 60
"""Number of choices for which trunk and head are evaluated too. They are the choices with the lowest costs
from geodesic distances."""
_OTHER_END_DISTANCE = 0.2
"""Minimum distance between two ends that count as different ends, as a fraction of the longest geodesic
distance."""


@dataclass(frozen=True)
class FiveEnds:
    """A choice of the five ends.

    Attributes:
        points: (5, 3) metres: head, two hands, two feet. The order within a pair has no meaning.
        distances: (5, C) geodesic distances from each end to all points of the surface, metres. If the head
            has two ends (such as ears), its distances start where the two ends separate.
        tree: the lengths of the limbs.
        chest, pelvis: (3,) points at which the limbs branch, metres.
        cost: 0 for a person of usual proportions that stands upright.
        margin: cost of the next best choice with other limbs, minus ``cost``.
    """

    points: Float
    distances: Float
    tree: LimbTree
    chest: Float
    pelvis: Float
    cost: float
    margin: float


def find_five_ends(limb_ends: LimbEnds, max_cost: float = np.inf) -> FiveEnds | None:
    """Finds the choice with the lowest cost. Returns None if the mesh has fewer than five ends, or if all
    choices cost more than ``max_cost``.
    """
    geodesics = limb_ends.distances_from(limb_ends.ends)
    end_distances = geodesics[:, limb_ends.ends]
    heads, chosen = _enumerate_choices(end_distances, limb_ends.longest)
    if not len(chosen):
        return None
    first, second = heads[chosen[:, 0]].T
    of_head = (end_distances[first] + end_distances[second] - end_distances[first, second][:, None]) / 2
    rows = np.arange(len(chosen))
    distances = [of_head[rows, chosen[:, k]] for k in range(1, 5)]
    distances += [end_distances[chosen[:, a], chosen[:, b]] for a in range(1, 5) for b in range(a + 1, 5)]
    cost, trees = tree_misfit(np.stack(distances, 1))
    cost += _compute_omitted_limb_cost(
        limb_ends, end_distances, np.column_stack([first, second, chosen[:, 1:]])
    )
    cost += _stance_cost(limb_ends, heads, chosen)
    cheapest = np.argsort(cost, kind="stable")[:_EVALUATED_CHOICES]
    if cost[cheapest[0]] > max_cost:
        return None
    best_choice, candidates, total = None, list[FiveEnds](), list[float]()
    for k in cheapest:
        if best_choice is not None and cost[k] > best_choice.cost + best_choice.margin:
            break
        head, *others = chosen[k]
        candidate, posture_cost = _evaluate_posture(
            limb_ends, geodesics, heads[head], np.array(others), LimbTree(*trees[k])
        )
        candidates.append(candidate)
        total.append(float(cost[k]) + posture_cost)
        best_choice = _with_margin(candidates, np.array(total), _OTHER_END_DISTANCE * limb_ends.longest)
    return best_choice if best_choice is not None and best_choice.cost <= max_cost else None


def five_ends_from_points(limb_ends: LimbEnds, points: Float) -> FiveEnds:
    """Returns the choice with ends at the given points (5, 3), metres: head, two hands, two feet."""
    nearest = np.array([np.linalg.norm(limb_ends.points - point, axis=1).argmin() for point in points])
    geodesics = limb_ends.distances_from(nearest)
    end_distances = geodesics[:, nearest]
    distances = [end_distances[a, b] for a in range(5) for b in range(a + 1, 5)]
    cost, trees = tree_misfit(np.array([distances]))
    tree = LimbTree(*trees[0])
    chest, pelvis = (
        point_at_distances(limb_ends.points, geodesics, wanted_distances)
        for wanted_distances in (tree.from_chest, tree.from_pelvis)
    )
    return FiveEnds(np.asarray(points, np.float64), geodesics, tree, chest, pelvis, float(cost[0]), np.inf)


def _enumerate_choices(between: Float, longest: float) -> tuple[Int, Int]:
    """Returns all candidate heads and all choices.

    Returns:
        (H, 2) the ends of each candidate head: the same end twice, or two ends with the head between them.
        (K, 5) choices: the index of a candidate head, and four ends.
    """
    count, limbs = len(between), list[int]()
    for end in range(count):
        if all(between[end, other] > _SAME_LIMB_DISTANCE * longest for other in limbs):
            limbs.append(end)
    two_end_heads = [
        (a, b) for a in range(count) for b in range(a) if between[a, b] < _EAR_DISTANCE * longest
    ]
    heads = np.array([(end, end) for end in range(count)] + two_end_heads).reshape(-1, 2)
    pairs = np.array([(a, b) for n, a in enumerate(limbs) for b in limbs[:n]]).reshape(-1, 2)
    numbers = np.arange(len(pairs))
    head, arms, legs = (
        g.ravel() for g in np.meshgrid(np.arange(len(heads)), numbers, numbers, indexing="ij")
    )
    ends = np.column_stack([heads[head], pairs[arms], pairs[legs]])
    clash = np.zeros(len(ends), bool)
    for a, b in (
        (0, 2),
        (0, 3),
        (0, 4),
        (0, 5),
        (1, 2),
        (1, 3),
        (1, 4),
        (1, 5),
        (2, 4),
        (2, 5),
        (3, 4),
        (3, 5),
    ):
        clash |= ends[:, a] == ends[:, b]
    return heads, np.column_stack([head, ends[:, 2:]])[~clash]


def _compute_omitted_limb_cost(extremities: LimbEnds, between: Float, chosen: Int) -> Float:
    """Returns the cost (K,) of the limbs that belong to none of the chosen ends (K, 6)."""
    is_near = between < _OWN_END_DISTANCE * extremities.longest
    is_near_chosen = is_near[chosen].any(1)
    length = np.minimum(extremities.prominence / extremities.longest, _MAX_LENGTH_FOR_COST)
    level = extremities.points[:, 1] - extremities.points[:, 1].min()
    leg = (level[extremities.ends] < _MAX_FOOT_HEIGHT * level.max()) & (length > _MIN_LEG_LENGTH)
    return np.asarray(~is_near_chosen @ (_OMITTED_LIMB_COST * length + _OMITTED_LEG_COST * leg), np.float64)


def _stance_cost(extremities: LimbEnds, heads: Int, chosen: Int) -> Float:
    """Returns the cost (K,) of an unlikely stance: on the head, with feet in the air, or with both hands
    above the head."""
    level = extremities.points[:, 1] - extremities.points[:, 1].min()
    relative_height = level[extremities.ends] / max(float(level.max()), 1e-12)
    head = relative_height[heads].mean(1)[chosen[:, 0]]
    hands, feet = relative_height[chosen[:, 1:3]], relative_height[chosen[:, 3:]]
    rise = (head + hands.mean(1)) / 2 - feet.mean(1)
    cost = _LOW_COST * np.maximum(_MIN_UPPER_HEIGHT - rise, 0.0) + _RAISED_HANDS_COST * (hands.min(1) > head)
    return np.asarray(cost + _HIGH_FOOT_COST * np.maximum(feet.max(1) - _MAX_FOOT_HEIGHT, 0.0))


def _evaluate_posture(
    extremities: LimbEnds, ways: Float, head: Int, others: Int, tree: LimbTree
) -> tuple[FiveEnds, float]:
    """Evaluates the posture of a choice. Returns the choice with its chest and pelvis, and the cost of a
    tilted trunk or head.
    """
    first, second = head
    of_head = (ways[first] + ways[second] - ways[first, extremities.ends[second]]) / 2
    rows = np.vstack([of_head, ways[others]])
    end_points = extremities.points[extremities.ends[others]]
    crown = extremities.points[int(np.argmin(ways[first] + ways[second] + abs(ways[first] - ways[second])))]
    chest, pelvis = (
        point_at_distances(extremities.points, rows, wanted_distances)
        for wanted_distances in (tree.from_chest, tree.from_pelvis)
    )
    trunk_direction, head_direction = unit(chest - pelvis), unit(crown - chest)
    posture_cost = _TILTED_HEAD_COST * (
        1.0 - float(head_direction @ trunk_direction)
    ) + _TILTED_TRUNK_COST * (1.0 - float(trunk_direction[1]))
    return FiveEnds(np.vstack([crown, end_points]), rows, tree, chest, pelvis, 0.0, 0.0), posture_cost


def _with_margin(choices: list[FiveEnds], total: Float, min_distance: float) -> FiveEnds:
    """Returns the choice with the lowest cost. Its margin is set relative to the next choice that has an end
    more than ``min_distance`` away.
    """
    best_index = int(total.argmin())
    best_choice, lowest_cost = choices[best_index], float(total[best_index])
    distances = np.linalg.norm(
        np.array([choice.points for choice in choices])[:, :, None] - best_choice.points, axis=3
    )
    arms, legs = (_pair_distances(distances[:, pair, pair]) for pair in (slice(1, 3), slice(3, 5)))
    elsewhere = np.max([distances[:, HEAD, HEAD], arms, legs], axis=0) > min_distance
    margin = float(total[elsewhere].min(initial=np.inf)) - lowest_cost
    return replace(best_choice, cost=lowest_cost, margin=margin)


def _pair_distances(distances: Float) -> Float:
    """Returns the distances (K,) between two pairs of ends. A distance is the larger of the two end-to-end
    distances (K, 2, 2), under the better assignment.
    """
    straight, crossed = distances[:, [0, 1], [0, 1]], distances[:, [0, 1], [1, 0]]
    return np.asarray(np.where(straight.sum(1) < crossed.sum(1), straight.max(1), crossed.max(1)))
