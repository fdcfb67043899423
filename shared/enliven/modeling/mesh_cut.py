"""Cutting a mesh where a surface passes through it, locally, into two closed meshes with their skins.

    cut_across_bone(mesh, skin, skeleton, bone, u) -> Cut        a plane across a bone, around that bone only
    cut_by_stroke(mesh, skin, stroke, posed=None) -> Cut         StrokeCut or PlaneCut, what it passes through

``Cut.near`` is the root's side of a bone (behind a plane), ``Cut.far`` the other; each is a :class:`Piece`
with its mesh, its skin (bones numbered as they were) and ``kept``, the old vertex of each vertex or -1.
Vertices away from the cut are the same to the bit, positions, colours and weights; so are faces, in their
order. Both sides of the cut share their caps' points, so that the volumes of the two add up to the whole.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from enliven.arrays import Bool, Float, Int
from enliven.character import SkinWeights
from enliven.errors import InputError
from enliven.mesh import Mesh, weld
from enliven.modeling import skin_values as skins
from enliven.modeling.caps import Cap, cap_of
from enliven.modeling.cut_loops import Crossings, area, chains_of, crossings_of, joined, winding
from enliven.modeling.cut_surfaces import CutSurface, PlaneCut
from enliven.settings import setting
from enliven.skeleton import Skeleton


@dataclass(frozen=True)
class CutSettings:
    """How meshes are cut."""

    slide: float = setting(
        0.15,
        "how far the cut may move so that it passes no vertex closely, of an edge's length",
        low=0.0,
        high=0.5,
    )
    gap: float = setting(
        0.3, "how much of a loop may be missing (holes of a scan) for it to be closed", low=0.0, high=1.0
    )
    fine: bool = setting(True, "give the caps points inside, so that they can bend and be rounded")


@dataclass(frozen=True)
class Piece:
    """One side of a cut.

    Attributes:
        mesh: its surface, the kept faces first, then the split ones, then the caps.
        skin: bones numbered as before the cut; None where the mesh had none.
        kept: (V,) for each vertex the one it was, or -1 for a new one.
        caps: how many faces at the end close it.
    """

    mesh: Mesh
    skin: SkinWeights | None
    kept: Int
    caps: int


@dataclass(frozen=True)
class Cut:
    """Both sides, and what there is to say about how they came about."""

    near: Piece
    far: Piece
    notes: tuple[str, ...] = ()


def cut_across_bone(
    mesh: Mesh,
    skin: SkinWeights,
    skeleton: Skeleton,
    bone: int,
    u: float,
    settings: CutSettings | None = None,
) -> Cut:
    """Cut the limb around a bone, square to the bone.

    Shells that the plane does not touch go with the bones that they follow.

    Args:
        mesh: at rest, in the skeleton's frame.
        bone: the joint that the bone ends at; not the root.
        u: where along the bone, 0 at its parent joint and 1 at its own.

    Raises:
        InputError: for a bone without length, or where no part of the mesh surrounds it there.
    """
    settings = settings or CutSettings()
    where = f"bone {skeleton.names[bone]!r}"
    if bone == 0 or not skeleton.lengths[bone] > 0:
        raise InputError("it has no length to cut across", where=where, mend="Choose another bone.")
    start = skeleton.positions[skeleton.parents[bone]]
    surface = PlaneCut(start + u * skeleton.vectors[bone], skeleton.vectors[bone])
    follows = np.zeros(max(skins.bone_count(skin), len(skeleton)))
    follows[list(skeleton.below(bone))] = 1.0
    follows[bone] = 0.5
    loyal = (follows[skin.indices] * skin.weights).sum(1)
    work = _Work(mesh, skin, surface, None, settings, loyal)
    work.choose_around(surface.flat(surface.point[None])[0], where)
    return work.cut()


def cut_by_stroke(
    mesh: Mesh,
    skin: SkinWeights | None,
    surface: CutSurface,
    posed: Float | None = None,
    settings: CutSettings | None = None,
) -> Cut:
    """Cut all that a stroke passes through; a part counts when the stroke covers at least half of it.

    Args:
        surface: :class:`enliven.modeling.cut_surfaces.StrokeCut`, or a PlaneCut.
        posed: (V, 3) where the vertices were when it was drawn; None takes the mesh as it is.

    Raises:
        InputError: where it passes through nothing.
    """
    work = _Work(mesh, skin, surface, posed, settings or CutSettings(), None)
    work.choose_covered()
    return work.cut()


@dataclass
class _Work:
    """A cut in the making: topology on the welded mesh, the result on the mesh as it is."""

    mesh: Mesh
    skin: SkinWeights | None
    surface: CutSurface
    posed: Float | None
    settings: CutSettings
    loyal: Float | None
    notes: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        if len(self.mesh.faces) == 0:
            raise InputError("it has no faces", where=self.mesh.name, mend="Give a mesh to cut.")
        at = self.mesh.vertices if self.posed is None else np.asarray(self.posed, np.float64)
        if at.shape != self.mesh.vertices.shape or not np.isfinite(at).all():
            raise InputError(
                f"{at.shape} positions, or some not finite", where=self.mesh.name, mend="Repair the mesh."
            )
        welded, self.of = weld(self.mesh)
        self.faces = welded.faces.astype(np.int64)
        first = np.zeros(len(welded.vertices), np.int64)
        first[self.of[::-1]] = np.arange(len(self.of))[::-1]
        self.first, self.rest, self.at = first, welded.vertices, at[first]
        self.field = self.surface.field(self.at)
        self.shift = self._clear_of_vertices()
        self.far = self.field > self.shift
        self.found: Crossings = crossings_of(self.faces, self.far)
        self.share = self._shares(self.found.edges)
        self.places = self.surface.flat(self._between(self.at, self.found.edges, self.share))
        self.chosen = np.zeros(0, np.int64)

    def _clear_of_vertices(self) -> float:
        """How far to move the cut to keep away from vertices: the middle of the widest gap near 0."""
        ends = self.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
        low, high = self.field[ends].min(1), self.field[ends].max(1)
        met = (low <= 0) & (high >= 0)
        if not met.any():
            return 0.0
        window = self.settings.slide * float(np.median((high - low)[met]))
        near = self.field[np.abs(self.field) < window]
        stops = np.concatenate([[-window], np.sort(near), [window]])
        wide = np.diff(stops)
        if len(near) == 0 or window == 0.0:
            return 0.0
        best = int(np.argmax(wide))
        return float((stops[best] + stops[best + 1]) / 2)

    def _between(self, at: Float, edges: Int, share: Float) -> Float:
        return np.asarray(at[edges[:, 0]] + share[:, None] * (at[edges[:, 1]] - at[edges[:, 0]]))

    def _shares(self, edges: Int) -> Float:
        """(E,) how far along each crossed edge the cut is; by bisection, as the field may be curved."""
        low, high = np.zeros(len(edges)), np.ones(len(edges))
        start = self.field[edges[:, 0]] - self.shift
        ends = self.field[edges[:, 1]] - self.shift
        guess = start / np.where(start != ends, start - ends, 1.0)
        if isinstance(self.surface, PlaneCut):
            return np.clip(guess, 1e-6, 1 - 1e-6)
        for _ in range(40):
            middle = (low + high) / 2
            value = self.surface.field(self._between(self.at, edges, middle)) - self.shift
            same = (value > 0) == (start > 0)
            low, high = np.where(same, middle, low), np.where(same, high, middle)
        return np.clip((low + high) / 2, 1e-6, 1 - 1e-6)

    def _polygon(self, loop: int) -> Float:
        """(P, 2) the longest chain of a loop, on the surface."""
        chains = chains_of(self.found.pairs[self.found.loops == loop])
        return self.places[max(chains, key=lambda chain: len(chain[0]))[0]]

    def choose_around(self, point: Float, where: str) -> None:
        """The loops around a place on the surface, and those inside of them."""
        polygons = [self._polygon(loop) for loop in np.unique(self.found.loops)]
        around = [i for i, polygon in enumerate(polygons) if abs(winding(polygon, point)) > 0.5]
        if not around:
            mend = "Cut it where its bone is inside of it, or with a stroke."
            raise InputError("no part of the mesh surrounds the bone there", where=where, mend=mend)
        # Loops within loops are one limb: the shell's inner side, or a bone in a sleeve.
        outer = max(around, key=lambda i: abs(area(polygons[i])))
        inside = [
            i for i, polygon in enumerate(polygons) if abs(winding(polygons[outer], polygon.mean(0))) > 0.5
        ]
        self.chosen = np.array(sorted({*around, *inside}), np.int64)
        self.point = point

    def choose_covered(self) -> None:
        """The loops that are drawn over for at least a half."""
        covered = self.surface.covers(self._between(self.at, self.found.edges, self.share))
        pairs = covered[self.found.pairs].mean(1)
        loops = np.unique(self.found.loops)
        self.chosen = np.array([i for i in loops if pairs[self.found.loops == i].mean() >= 0.5], np.int64)
        if len(self.chosen) == 0:
            what = "it passes through no part of the mesh"
            raise InputError(what, where="cut", mend="Draw it right across what is to be cut.")
        self.point = self.places[covered].mean(0)

    def cut(self) -> Cut:
        """Both pieces, once the chosen loops part the mesh."""
        side = self._sides()
        if not side.any() or side.all():
            raise InputError("it parts nothing off", where="cut", mend="Cut elsewhere.")
        caps = self._caps()
        near, far = (self._piece(side == bool(half), caps, bool(half)) for half in (0, 1))
        return Cut(near, far, tuple(self.notes))

    def _sides(self) -> Bool:
        """(W,) whether each welded vertex is on the far side; cuts more loops where the mesh still hangs."""
        while True:
            cut = np.isin(self.found.loops, self.chosen)
            part = self._components(cut)
            faces = self.faces[self.found.faces[cut]]
            labels = part[faces]
            far = self.far[faces]
            torn = np.intersect1d(labels[far], labels[~far])
            if len(torn) == 0:
                break
            self._choose_another(part, torn)
        side = np.full(part.max() + 1, -1)
        side[labels[far]], side[labels[~far]] = 1, 0
        for shell in np.flatnonzero(side < 0):
            side[shell] = self._side_of(np.flatnonzero(part == shell), part, side)
        return np.asarray(side[part] == 1)

    def _components(self, cut: Bool) -> Int:
        """(W,) what still hangs together once the chosen crossed faces are split."""
        whole = np.ones(len(self.faces), bool)
        whole[self.found.faces[cut]] = False
        faces = self.faces[whole]
        links = [faces[:, [0, 1]], faces[:, [1, 2]]]
        split = self.faces[self.found.faces[cut]]
        for a, b in ((0, 1), (1, 2), (2, 0)):
            same = self.far[split[:, a]] == self.far[split[:, b]]
            links.append(split[same][:, [a, b]])
        ends = np.concatenate(links)
        count = len(self.rest)
        web = coo_matrix((np.ones(len(ends), np.int8), (ends[:, 0], ends[:, 1])), (count, count))
        return np.asarray(connected_components(web, directed=False)[1], np.int64)

    def _choose_another(self, part: Int, torn: Int) -> None:
        """Add the nearest loop through which the two sides still hang together."""
        free = ~np.isin(self.found.loops, self.chosen)
        free &= np.isin(part[self.faces[self.found.faces, 0]], torn)
        middle = self.places[self.found.pairs].mean(1)
        far = np.where(free, np.linalg.norm(middle - self.point, axis=1), np.inf)
        if not np.isfinite(far).any():
            raise InputError("its two sides cannot be told apart", where="cut", mend="Repair the mesh first.")
        self.chosen = np.append(self.chosen, self.found.loops[int(np.argmin(far))])
        note = "the parts hung together elsewhere too: that was cut as well"
        if note not in self.notes:
            self.notes.append(note)

    def _side_of(self, vertices: Int, part: Int, side: Int) -> int:
        """Where a shell goes that was not cut: with the bones it follows, else with what is nearest."""
        if self.loyal is not None:
            mean = float(self.loyal[np.isin(self.of, vertices)].mean())
            if abs(mean - 0.5) > 1e-3:
                return int(mean > 0.5)
            return int(self.far[vertices].mean() > 0.5)
        known = np.flatnonzero(side[part] >= 0)
        _, nearest = cKDTree(self.at[known]).query(self.at[vertices[:: 1 + len(vertices) // 64]])
        return int(np.mean(side[part[known[nearest]]]) > 0.5)

    def _caps(self) -> list[Cap]:
        """A cap for every shell that was cut, its rim as numbers of crossed edges."""
        cut = np.isin(self.found.loops, self.chosen)
        count = len(self.rest)
        ends = self.faces[:, [0, 1, 1, 2]].reshape(-1, 2)
        web = coo_matrix((np.ones(len(ends), np.int8), (ends[:, 0], ends[:, 1])), (count, count))
        shell = connected_components(web, directed=False)[1][self.faces[self.found.faces, 0]]
        made = []
        for one in np.unique(shell[cut]):
            chains = chains_of(self.found.pairs[cut & (shell == one)])
            loops = [
                order
                for order, shut in joined(chains, self.places, self.settings.gap)
                if shut and len(order) > 2
            ]
            if len(loops) < len(chains) and "some of it is open there and was left open" not in self.notes:
                self._say_open(chains, loops)
            if loops:
                made.append(cap_of(loops, self.places, self.settings.fine))
        return made

    def _say_open(self, chains: list[tuple[Int, bool]], loops: list[Int]) -> None:
        if sum(len(chain) for chain, _ in chains) > sum(len(loop) for loop in loops):
            self.notes.append("some of it is open there and was left open")

    def _piece(self, keeps: Bool, caps: list[Cap], far: bool) -> Piece:
        """The faces of one side, with its part of the split ones and its caps."""
        return _PieceMaker(self, keeps, far).piece(caps)


class _PieceMaker:
    """Puts one side together: kept vertices, new ones on crossed edges, then those inside of caps."""

    def __init__(self, work: _Work, keeps: Bool, far: bool) -> None:
        self.work, self.far = work, far
        self.mesh = work.mesh
        cut = np.isin(work.found.loops, work.chosen)
        self.split = work.found.faces[cut]
        self.pairs = work.found.pairs[cut]
        whole = np.ones(len(self.mesh.faces), bool)
        whole[self.split] = False
        self.whole = whole & keeps[work.faces[:, 0]]
        self.kept = np.flatnonzero(keeps[work.of])
        self.number = np.full(len(self.mesh.vertices), -1, np.int64)
        self.number[self.kept] = np.arange(len(self.kept))

    def piece(self, caps: list[Cap]) -> Piece:
        """The piece."""
        split, sources, edges = self._split_faces()
        base = len(self.kept)
        doubled = len(self.work.rest) < len(self.mesh.vertices)
        cap_faces, rims, insides = [], [], []
        count = base + len(sources)
        rim_of = np.full(len(self.work.found.edges), -1, np.int64)
        rim_of[edges[::-1]] = base + np.arange(len(edges))[::-1]
        for cap in caps:
            if doubled:
                # Flat-shaded meshes have a vertex for each side of an edge: so has the rim.
                rim = count + np.arange(len(cap.rim))
                rims.append(rim_of[cap.rim])
                count += len(rim)
            else:
                rim = rim_of[cap.rim]
            inside = count + np.arange(len(cap.inside))
            insides.append((rim_of[cap.rim], cap.inside))
            count += len(inside)
            faces = np.concatenate([rim, inside])[cap.faces]
            cap_faces.append(faces[:, ::-1] if self.far else faces)
            if doubled:
                insides[-1] = (rim_of[cap.rim], np.concatenate([np.eye(len(cap.rim)), cap.inside]))
        closing = np.concatenate([np.zeros((0, 3), np.int64), *cap_faces])
        faces = np.concatenate([self.number[self.mesh.faces[self.whole]], split, closing])
        vertices, colours, skin = self._attributes(sources, edges, insides)
        kept = np.full(len(vertices), -1, np.int64)
        kept[:base] = self.kept
        mesh = Mesh(vertices, faces.astype(np.int32), self.mesh.name, colours)
        return Piece(mesh, skin, kept, len(closing))

    def _split_faces(self) -> tuple[Int, Int, Int]:
        """(S, 3) faces, and for each new vertex its two old ones (N, 2) and its crossed edge (N,)."""
        work = self.work
        own = self.mesh.faces[self.split].astype(np.int64)
        side = work.far[work.of[own]]
        lonely = np.where(side.sum(1) == 1, np.argmax(side, 1), np.argmin(side, 1))
        corner = np.take_along_axis(own, (lonely[:, None] + np.arange(3)) % 3, 1)
        lonely_far = np.take_along_axis(side, lonely[:, None], 1)[:, 0]
        pairs = np.where(lonely_far[:, None], self.pairs, self.pairs[:, ::-1])
        # A new vertex for each pair of old ones: on flat-shaded meshes one for each face.
        ends = np.stack([corner[:, [0, 1]], corner[:, [2, 0]]], 1).reshape(-1, 2)
        crossed = pairs.reshape(-1)
        turned = work.of[ends[:, 0]] != work.found.edges[crossed, 0]
        ends = np.where(turned[:, None], ends[:, ::-1], ends)
        unique, first, number = np.unique(ends, axis=0, return_index=True, return_inverse=True)
        new = len(self.kept) + number.reshape(-1, 2)
        alone = lonely_far == self.far
        a, b, c = self.number[corner].T
        tips = np.stack([a, new[:, 0], new[:, 1]], 1)[alone]
        quad = np.stack([new[:, 0], b, c, new[:, 1]], 1)[~alone]
        return np.concatenate([tips, quad[:, [0, 1, 2]], quad[:, [0, 2, 3]]]), unique, crossed[first]

    def _attributes(
        self, sources: Int, edges: Int, insides: list[tuple[Int, Float]]
    ) -> tuple[Float, np.ndarray | None, SkinWeights | None]:  # type: ignore[type-arg]
        """Positions, colours and skin of all vertices."""
        work, mesh = self.work, self.mesh
        share = work.share[edges][:, None]
        base = len(self.kept)

        def grown(old: Float, rim: Float | None = None) -> Float:
            """The values at the new vertices: along the edges, and inside of caps from their rims."""
            made = old[sources[:, 0]] * (1 - share) + old[sources[:, 1]] * share if rim is None else rim
            inner = [weights @ made[around - base] for around, weights in insides]
            return np.concatenate([made, *inner])

        between = work._between(work.rest, work.found.edges, work.share)[edges]
        vertices = np.concatenate([mesh.vertices[self.kept], grown(mesh.vertices, between)])
        colours = None
        if mesh.colours is not None:
            new = np.clip(np.rint(grown(mesh.colours.astype(np.float64))), 0, 255).astype(np.uint8)
            colours = np.concatenate([mesh.colours[self.kept], new])
        if work.skin is None:
            return vertices, colours, None
        old = np.unique(sources)
        few = np.searchsorted(old, sources)
        full = skins.dense(skins.taken(work.skin, old), skins.bone_count(work.skin))
        made = full[few[:, 0]] * (1 - share) + full[few[:, 1]] * share
        new_skin = skins.sparse(grown(np.zeros((0, 0)), made))
        return vertices, colours, skins.stacked([skins.taken(work.skin, self.kept), new_skin])
