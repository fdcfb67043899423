"""The chordal axis of an outline, with its width: it connects the midpoints of chords of the triangulation.

L. Prasad, "Morphological analysis of shapes", 1997: triangles with two sides on the outline are terminal,
triangles with one such side are sleeves, and triangles without such a side are junctions. A terminal branch
is removed if it lies completely in the circle around the chord that cuts it off, with the chord as its
diameter (T. Igarashi et al., "Teddy", 1999). So round ends and bumps do not get a branch.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from enliven.arrays import Float, Int
from enliven.modeling.sketching.axis import TIP, Axis, merge_junctions, remove_spurs, smooth

_MAX_BUMP_RADII = 1.2
"""A branch is a bump if all of it is within this distance of the middle of its chord, in radii of the chord's
circle."""
_ROUND_MOMENT_RATIO = 0.8
"""An outline without limbs is round if the ratio of its smaller to its larger second moment is above this."""


def chordal_axis(outline: Float, triangles: Int) -> Axis:
    """Returns the axis of (N, 2) counter-clockwise points with (T, 3) constrained Delaunay triangles."""
    return _Tracer(outline, triangles).axis()


@dataclass
class _Tracer:
    outline: Float
    triangles: Int
    points: list[Float] = field(default_factory=list)
    radii: list[float] = field(default_factory=list)
    links: list[tuple[int, int]] = field(default_factory=list)

    def __post_init__(self) -> None:
        count = len(self.outline)
        # List the inner edges as pairs of a triangle and a side. Side k is opposite to corner k.
        starts, ends = self.triangles[:, [1, 2, 0]], self.triangles[:, [2, 0, 1]]
        key = np.minimum(starts, ends) * count + np.maximum(starts, ends)
        flat = key.ravel()
        order = np.argsort(flat, kind="stable")
        same = np.flatnonzero(flat[order][1:] == flat[order][:-1])
        beside = np.full(len(flat), -1, np.int64)
        beside[order[same]], beside[order[same + 1]] = order[same + 1] // 3, order[same] // 3
        self.beside: Int = beside.reshape(-1, 3)
        self.key = key
        self.chord: dict[int, int] = {}
        self.tips: dict[int, Int] = {}

    def axis(self) -> Axis:
        """Removes bumps, starting at every terminal triangle, and connects the remaining triangles to an
        axis."""
        is_pruned, tips = self._prune_bumps()
        remaining = [t for t in range(len(self.triangles)) if not is_pruned[t]]
        if not remaining:
            return self._make_single_bone_axis()
        for t in remaining:
            open_sides = [k for k in range(3) if self.beside[t, k] >= 0 and not is_pruned[self.beside[t, k]]]
            nodes = [self._chord_node(t, k) for k in open_sides]
            closed = [k for k in range(3) if self.beside[t, k] >= 0 and is_pruned[self.beside[t, k]]]
            if len(nodes) == 2:
                self.links.append((nodes[0], nodes[1]))
            elif len(nodes) == 3:
                self._add_junction(t, nodes)
            elif len(nodes) == 1:
                self._add_end(t, nodes[0], closed, tips)
        if len(remaining) == 1:
            return self._make_single_bone_axis()
        return self._link_chains()

    def _prune_bumps(self) -> tuple[list[bool], dict[int, list[int]]]:
        """Returns a flag for each triangle that is True in bumps. Also returns a dictionary from a triangle
        to the outline points of the bump next to it."""
        is_pruned = [False] * len(self.triangles)
        bumps: dict[int, list[int]] = {}
        sides = (self.beside >= 0).sum(1)
        waiting: list[int] = np.flatnonzero(sides == 1).tolist()
        while waiting:
            t = waiting.pop()
            inner_sides = [k for k in range(3) if self.beside[t, k] >= 0 and not is_pruned[self.beside[t, k]]]
            if len(inner_sides) != 1 or is_pruned[t]:
                continue
            k = inner_sides[0]
            region = sorted({*bumps.get(t, []), *(int(v) for v in self.triangles[t])})
            a, b = self.outline[self.triangles[t, (k + 1) % 3]], self.outline[self.triangles[t, (k + 2) % 3]]
            middle, radius = (a + b) / 2, float(np.linalg.norm(a - b)) / 2
            if np.linalg.norm(self.outline[region] - middle, axis=1).max() > _MAX_BUMP_RADII * radius:
                continue
            is_pruned[t] = True
            other = int(self.beside[t, k])
            bumps[other] = sorted({*bumps.get(other, []), *region})
            waiting.append(other)
        return is_pruned, bumps

    def _add_node(self, point: Float, radius: float) -> int:
        self.points.append(point)
        self.radii.append(radius)
        return len(self.points) - 1

    def _chord_node(self, t: int, k: int) -> int:
        """Returns the number of the axis point in the middle of side ``k`` of triangle ``t``."""
        key = int(self.key[t, k])
        if key not in self.chord:
            a, b = self.outline[self.triangles[t, (k + 1) % 3]], self.outline[self.triangles[t, (k + 2) % 3]]
            self.chord[key] = self._add_node((a + b) / 2, float(np.linalg.norm(a - b)) / 2)
        return self.chord[key]

    def _add_junction(self, t: int, nodes: list[int]) -> None:
        corners = self.outline[self.triangles[t]]
        middle = corners.mean(0)
        centre = self._add_node(middle, float(np.linalg.norm(corners - middle, axis=1).mean()))
        self.links += [(node, centre) for node in nodes]

    def _add_end(self, t: int, node: int, closed: list[int], bumps: dict[int, list[int]]) -> None:
        """Adds an end of the axis, from the last chord and the outline points beyond it."""
        region = np.array(sorted({*bumps.get(t, []), *(int(v) for v in self.triangles[t])}))
        end_node = self._chord_node(t, closed[0]) if len(closed) == 1 else node
        if end_node != node:
            self.links.append((node, end_node))
        self.tips[end_node] = region

    def _make_single_bone_axis(self) -> Axis:
        """Returns the axis of an outline without limbs: a single bone along its longest extent."""
        middle = self.outline.mean(0)
        spread = (self.outline - middle).T @ (self.outline - middle)
        sizes, axes = np.linalg.eigh(spread)
        # If length and width of the shape are about equal, use the vertical as its axis.
        along = axes[:, 1] if sizes[0] < _ROUND_MOMENT_RATIO * sizes[1] else np.array([0.0, 1.0])
        reach = 0.35 * float(np.ptp((self.outline - middle) @ along))
        points = np.stack([middle - reach * along, middle, middle + reach * along])
        inscribed = np.linalg.norm(self.outline - points[:, None], axis=2).min(1)
        return Axis(points, inscribed, [[0, 1, 2]])

    def _link_chains(self) -> Axis:
        """Converts the links to chains between ends and junctions. Nearby junctions are merged."""
        beside: dict[int, list[int]] = {i: [] for i in range(len(self.points))}
        for a, b in self.links:
            beside[a].append(b)
            beside[b].append(a)
        stops = [i for i, near in beside.items() if len(near) not in (0, 2)]
        chains, used = [], set()
        for start in stops:
            for first in beside[start]:
                if (start, first) in used:
                    continue
                chain = [start, first]
                while len(beside[chain[-1]]) == 2:
                    a, b = beside[chain[-1]]
                    chain.append(b if a == chain[-2] else a)
                used |= {(chain[0], chain[1]), (chain[-1], chain[-2])}
                chains.append(self._straighten_to_tip(self._straighten_to_tip(chain[::-1])[::-1]))
        if not chains:
            return self._make_single_bone_axis()
        axis = Axis(np.array(self.points), np.array(self.radii), chains)
        for chain in chains:
            axis.points[chain] = smooth(axis.points[chain])
        return merge_junctions(remove_spurs(axis))

    def _straighten_to_tip(self, chain: list[int]) -> list[int]:
        """Returns a chain with its end straightened towards the tip, because its last points are off-centre
        in a round or flat end."""
        region = self.tips.get(chain[-1])
        if region is None:
            return chain
        points, radii = np.array(self.points)[chain], np.array(self.radii)[chain]
        along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
        far = along[-1] - along
        base = int(np.flatnonzero(far >= min(radii[-1], 0.5 * along[-1]))[-1])
        last_outside = int(np.flatnonzero(far >= min(far[base] + radii[-1], along[-1]))[-1])
        if last_outside == base:
            last_outside, base = 0, max(base, 1)
        ahead = points[base] - points[last_outside]
        ahead = ahead / max(float(np.linalg.norm(ahead)), 1e-300)
        reach = float(((self.outline[region] - points[base]) @ ahead).max()) - TIP * radii[base]
        end = self._add_node(points[base] + max(reach, 0.1 * radii[base]) * ahead, 0.5 * float(radii[base]))
        return [*chain[: base + 1], end]
