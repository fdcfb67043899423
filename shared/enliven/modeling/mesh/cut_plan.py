"""The plan of a cut: the loops of the mesh to cut, the side of each vertex, and the caps that close both
sides."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import scipy

from enliven.arrays import Bool, Float, Int
from enliven.deformation.graph.connectivity import label_components
from enliven.document import SkinWeights
from enliven.errors import InputError
from enliven.meshes import Mesh, weld
from enliven.modeling.mesh.caps import Cap, flatten_loop, triangulate_cap
from enliven.modeling.mesh.cut_loops import (
    Crossings,
    find_crossings,
    join_chains,
    order_chains,
    signed_area,
    winding_number,
)
from enliven.modeling.mesh.cut_surfaces import CutSurface, PlaneCut
from enliven.settings import parameter

_MAX_SLIDE_EDGES = 0.15
"""Maximum shift that keeps the cut away from vertices, as a fraction of an edge length. Such a small shift is
not visible."""
_MAX_GAP_FRACTION = 0.3
"""Maximum gap in a loop, as a fraction of its length, across which the loop is closed. Scans have holes."""
_SIDES = ((0, 1), (1, 2), (2, 0))
"""For each of a triangle's three sides: the numbers of its two corners."""
_MIN_ISLAND_FRACTION = 0.05
"""Minimum size of an island (connected vertices on one side of the cut) that is cut out, as a fraction of all
vertices on that side. Cuts along skin weights can create smaller islands, which are not cut out."""


@dataclass(frozen=True)
class CutSettings:
    """Settings for the caps that close a cut."""

    rounding: float = parameter(
        0.0,
        "Roundness of the caps that close a cut. 0 is a flat cap, and 1 is a hemisphere.",
        low=0.0,
        high=1.0,
    )
    fine: bool = parameter(True, "Adds vertices inside the caps, so that the caps can bend and be rounded.")


@dataclass
class CutPlan:
    """The plan of a cut. Connectivity is that of the welded mesh. Vertex numbers in the result are those of
    the given mesh."""

    mesh: Mesh
    skin: SkinWeights | None
    surface: CutSurface
    posed: Float | None
    settings: CutSettings
    loyal: Float | None
    values: Float | None = None
    """(V,) values of a scalar field that replaces the cutting surface's own field. Caps are then only near
    the cutting surface."""
    notes: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        if len(self.mesh.faces) == 0:
            raise InputError(
                "a mesh without faces cannot be cut", where=self.mesh.name, remedy="Choose a mesh with faces."
            )
        posed_vertices = self.mesh.vertices if self.posed is None else np.asarray(self.posed, np.float64)
        if posed_vertices.shape != self.mesh.vertices.shape or not np.isfinite(posed_vertices).all():
            raise InputError(
                f"the posed vertex positions have the wrong shape {posed_vertices.shape} or are not finite",
                where=self.mesh.name,
                remedy="Repair the mesh.",
            )
        welded, self.of = weld(self.mesh)
        self.faces = welded.faces.astype(np.int64)
        first = np.zeros(len(welded.vertices), np.int64)
        first[self.of[::-1]] = np.arange(len(self.of))[::-1]
        self.first, self.rest, self.at = first, welded.vertices, posed_vertices[first]
        self.field = (
            self.surface.compute_distances(self.at) if self.values is None else self._remove_islands()
        )
        self.shift = self._offset_off_vertices()
        self.far = self.field > self.shift
        self.found: Crossings = find_crossings(self.faces, self.far)
        self.share = self._find_crossing_positions(self.found.edges)
        self.places = self.surface.compute_coordinates(
            self.interpolate_on_edges(self.at, self.found.edges, self.share)
        )
        self.count = int(self.found.loops.max(initial=-1)) + 1
        self.chosen = np.zeros(0, np.int64)

    def _offset_off_vertices(self) -> float:
        """Returns an offset for the field values that keeps the cut away from vertices. It is the middle of
        the widest gap between field values near 0."""
        ends = self.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
        low, high = self.field[ends].min(1), self.field[ends].max(1)
        is_cut = (low <= 0) & (high >= 0)
        if not is_cut.any():
            return 0.0
        window = _MAX_SLIDE_EDGES * float(np.median((high - low)[is_cut]))
        near = self.field[np.abs(self.field) < window]
        stops = np.concatenate([[-window], np.sort(near), [window]])
        wide = np.diff(stops)
        if len(near) == 0 or window == 0.0:
            return 0.0
        best = int(np.argmax(wide))
        return float((stops[best] + stops[best + 1]) / 2)

    def _remove_islands(self) -> Float:
        """Returns the field values (W,). The sign is changed at small islands of vertices, so that they are
        not cut out."""
        assert self.values is not None
        values = self.values[self.first]
        far = values > 0
        same = [self.faces[far[self.faces[:, a]] == far[self.faces[:, b]]][:, [a, b]] for a, b in _SIDES]
        part = label_components(len(values), np.concatenate(same))
        size = np.bincount(part)
        of_side = np.array([(~far).sum(), far.sum()])[far.astype(np.int64)]
        small = size[part] < _MIN_ISLAND_FRACTION * of_side
        return np.asarray(np.where(small, -1e-9 * np.sign(values), values))

    def choose_all(self) -> None:
        """Marks every loop of the plan for cutting."""
        self.chosen = np.arange(self.count)
        self.point = self.places.mean(0) if len(self.places) else np.zeros(2)

    def interpolate_on_edges(self, at: Float, edges: Int, fractions: Float) -> Float:
        """Returns points (E, 3) at ``fractions`` along edges (E, 2) of vertices at ``at`` (V,
        3)."""
        return np.asarray(at[edges[:, 0]] + fractions[:, None] * (at[edges[:, 1]] - at[edges[:, 0]]))

    def _find_crossing_positions(self, edges: Int) -> Float:
        """Returns the position (E,) of the cut along each crossed edge, as a fraction. It is found by
        bisection, since the field may be nonlinear.
        """
        low, high = np.zeros(len(edges)), np.ones(len(edges))
        start = self.field[edges[:, 0]] - self.shift
        ends = self.field[edges[:, 1]] - self.shift
        guess = start / np.where(start != ends, start - ends, 1.0)
        if isinstance(self.surface, PlaneCut):
            return np.clip(guess, 1e-6, 1 - 1e-6)
        for _ in range(40):
            middle = (low + high) / 2
            value = (
                self.surface.compute_distances(self.interpolate_on_edges(self.at, edges, middle)) - self.shift
            )
            same = (value > 0) == (start > 0)
            low, high = np.where(same, middle, low), np.where(same, high, middle)
        return np.clip((low + high) / 2, 1e-6, 1 - 1e-6)

    def _find_longest_chain(self, loop: int) -> Float:
        """Returns the longest chain of a loop as (P, 2) coordinates on the cutting surface."""
        chains = order_chains(self.found.pairs[self.found.loops == loop])
        return self.places[max(chains, key=lambda chain: len(chain[0]))[0]]

    def choose_around(self, point: Float, bone_weights: Float, where: str) -> None:
        """Marks for cutting the loops around a point on the cutting surface, and the loops inside them.

        Args:
            bone_weights: (V,) skin weight of the cut bone at each vertex.
        """
        self.point = point
        polygons = [self._find_longest_chain(loop) for loop in range(self.count)]
        around = [i for i, polygon in enumerate(polygons) if abs(winding_number(polygon, point)) > 0.5]
        if not around:
            around = self._find_neighbouring_loop(point, bone_weights, polygons)
            note = (
                "the bone is outside of the mesh at the cut, so the nearest part that follows the "
                "bone was cut"
            )
            self.notes += [note] if around else []
        if not around:
            self._separate_shells(where)
            return
        # Loops inside other loops belong to the same limb, such as the inner side of a shell, or the arm in a
        # sleeve.
        outer = max(around, key=lambda i: abs(signed_area(polygons[i])))
        inside = [
            i
            for i, polygon in enumerate(polygons)
            if abs(winding_number(polygons[outer], polygon.mean(0))) > 0.5
        ]
        self.chosen = np.array(sorted({*around, *inside}), np.int64)

    def _find_neighbouring_loop(self, point: Float, bone_weights: Float, polygons: list[Float]) -> list[int]:
        """Returns the nearest loop that follows the bone, if the loop's distance is below its radius."""
        of_bone = np.zeros(len(self.rest))
        np.maximum.at(of_bone, self.of, bone_weights)
        best: tuple[float, list[int]] = (1.0, [])
        for i, polygon in enumerate(polygons):
            faces = self.faces[self.found.faces[self.found.loops == i]]
            thick = np.sqrt(abs(signed_area(polygon)) / np.pi)
            far = float(np.linalg.norm(polygon - point, axis=1).min()) / max(thick, 1e-300)
            if of_bone[faces].mean() > 0.3 and far < best[0]:
                best = (far, [i])
        return best[1]

    def _separate_shells(self, where: str) -> None:
        """Separates whole shells by the bones that they follow, without cutting them. Each shell must clearly
        follow one side."""
        assert self.loyal is not None
        part = self._components_after_cut(np.zeros(len(self.found.loops), bool))[self.of]
        mean = np.bincount(part, self.loyal) / np.maximum(np.bincount(part), 1)
        if not ((mean > 0.75).any() and (mean < 0.25).any()) or ((mean > 0.25) & (mean < 0.75)).any():
            remedy = "Cut at a position where the bone is inside the mesh, or cut by a drawn stroke."
            raise InputError("no part of the mesh surrounds the bone at the cut", where=where, remedy=remedy)
        self.notes.append(
            "no part of the mesh surrounds the bone at the cut, so the separate shells were "
            "divided without a cut"
        )

    def choose_covered(self) -> None:
        """Marks for cutting the loops with at least half of their points under the drawn stroke."""
        covered = self.surface.covers(self.interpolate_on_edges(self.at, self.found.edges, self.share))
        pairs = covered[self.found.pairs].mean(1)
        loops = np.unique(self.found.loops)
        self.chosen = np.array([i for i in loops if pairs[self.found.loops == i].mean() >= 0.5], np.int64)
        if len(self.chosen) == 0:
            problem = "the stroke does not cross the mesh"
            raise InputError(
                problem, where="cut", remedy="Draw the stroke across the part that you want to cut."
            )
        self.point = self.places[covered].mean(0)

    def sides(self) -> Bool:
        """Returns (W,) True for welded vertices on the far side. Further loops are cut until the two sides
        are no longer connected.
        """
        while True:
            cut = np.isin(self.found.loops, self.chosen)
            part = self._components_after_cut(cut)
            faces = self.faces[self.found.faces[cut]]
            labels = part[faces]
            far = self.far[faces]
            torn = np.intersect1d(labels[far], labels[~far])
            if len(torn) == 0:
                break
            self._add_nearest_loop(part, torn)
        side = np.full(int(part.max()) + 1, -1)
        side[labels[far]], side[labels[~far]] = 1, 0
        for shell in np.flatnonzero(side < 0):
            side[shell] = self._find_side(np.flatnonzero(part == shell), part, side)
        return np.asarray(side[part] == 1)

    def _components_after_cut(self, cut: Bool) -> Int:
        """Returns the connected component (W,) of each vertex after the given crossed faces are split."""
        is_whole = np.ones(len(self.faces), bool)
        is_whole[self.found.faces[cut]] = False
        faces = self.faces[is_whole]
        links = [faces[:, [0, 1]], faces[:, [1, 2]]]
        split = self.faces[self.found.faces[cut]]
        for a, b in _SIDES:
            same = self.far[split[:, a]] == self.far[split[:, b]]
            links.append(split[same][:, [a, b]])
        return label_components(len(self.rest), np.concatenate(links))

    def _add_nearest_loop(self, part: Int, torn: Int) -> None:
        """Marks for cutting the nearest loop at which the two sides are still connected."""
        free = ~np.isin(self.found.loops, self.chosen)
        free &= np.isin(part[self.faces[self.found.faces, 0]], torn)
        middle = self.places[self.found.pairs].mean(1)
        far = np.where(free, np.linalg.norm(middle - self.point, axis=1), np.inf)
        if not np.isfinite(far).any():
            raise InputError(
                "the two sides of the cut cannot be separated",
                where="cut",
                remedy="Repair the mesh, and cut again.",
            )
        self.chosen = np.append(self.chosen, self.found.loops[int(np.argmin(far))])
        note = "the two parts were also connected at another position, so the mesh was cut there, too"
        if note not in self.notes:
            self.notes.append(note)

    def _find_side(self, vertices: Int, part: Int, side: Int) -> int:
        """Returns the side of an uncut shell: the side of the bones that it follows, or else the side of the
        nearest surface."""
        if self.loyal is not None:
            mean = float(self.loyal[np.isin(self.of, vertices)].mean())
            if abs(mean - 0.5) > 1e-3:
                return int(mean > 0.5)
            return int(self.far[vertices].mean() > 0.5)
        decided = np.flatnonzero(side[part] >= 0)
        some = self.at[vertices[:: 1 + len(vertices) // 64]]
        _, nearest = scipy.spatial.cKDTree(self.at[decided]).query(some)
        return int(np.mean(side[part[decided[nearest]]]) > 0.5)

    def caps(self) -> list[Cap]:
        """Returns a cap for every shell that was cut. The rim of a cap consists of numbers of crossed
        edges."""
        cut = np.isin(self.found.loops, self.chosen)
        ends = self.faces[:, [0, 1, 1, 2]].reshape(-1, 2)
        shell = label_components(len(self.rest), ends)[self.faces[self.found.faces, 0]]
        caps = []
        for shell_number in np.unique(shell[cut]):
            chains = order_chains(self.found.pairs[cut & (shell == shell_number)])
            loops = [
                order
                for order, shut in join_chains(chains, self.places, _MAX_GAP_FRACTION)
                if shut and len(order) > 2
            ]
            note = "the surface has an opening at the cut, so the cut could not be closed completely"
            left_open = sum(len(chain) for chain, _ in chains) > sum(len(loop) for loop in loops)
            if len(loops) < len(chains) and left_open and note not in self.notes:
                self.notes.append(note)
            if self.values is not None:
                caps += [self._make_own_cap(loop) for loop in loops]
            elif loops:
                caps.append(triangulate_cap(loops, self.places, self.settings.fine))
        return caps

    def _make_own_cap(self, loop: Int) -> Cap:
        """Returns a cap for a loop, triangulated in the best-fitting plane of the loop."""
        points = self.interpolate_on_edges(self.at, self.found.edges[loop], self.share[loop])
        cap = triangulate_cap([np.arange(len(loop))], flatten_loop(points), self.settings.fine)
        return Cap(loop[cap.rim], cap.faces, cap.inner_points)
