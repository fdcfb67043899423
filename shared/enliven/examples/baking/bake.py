"""Converts an animated surface to a skinned mesh: fits transforms over time, at most four per vertex.

    baked = bake_surface(mesh, frames, traits, held=[4711, 12])
    print(baked.error)

Weights and transforms are fitted alternately (smooth skinning decomposition, B. H. Le and Z. Deng, 2012).
Transforms begin at the control points and spread over the surface. While the error is too large, more
transforms are added where it is greatest. Weights are fitted to the frames that differ most from one another.
Then the transforms of every frame are computed, and the error is measured. Frames are processed in sequence
and are not stored.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from enliven.arrays import Float, Int, Int32
from enliven.document import SkinWeights
from enliven.examples.baking.maps import Maps, add_errors
from enliven.examples.baking.nodes import EdgeGraph, Seeds
from enliven.examples.baking.settings import BakeError, BakeSettings
from enliven.examples.baking.weights import fit_weights
from enliven.meshes import Mesh, weld

_CANDIDATE_TRANSFORMS = 8
"""Number of nearby transforms that a vertex may follow. At most four of them remain."""


Frames = Callable[[], Iterable[Float]]
"""A function that returns a new iterator over all frames (V, 3) metres at each call."""
_CHUNK_FRAMES = 16
"""Number of frames that are processed together."""
_MAX_REFITS = 3
"""Maximum number of refits, each after frames with too large errors were added to the fit."""
_MAX_FRAMES_ADDED = 16
"""Maximum number of frames that are added at once, the worst first. Each frame costs time in every round."""
_FINAL_ROUNDS = 5
"""Number of final fitting rounds, in which the transforms are restricted to the form of a glTF node:
rotation, and scale along fixed axes.
"""


@dataclass(frozen=True, eq=False)
class BakedSurface:
    """Transforms of a skinned mesh over time. Vertex v moves to x = sum_k w_k (linear_k (v - pivot_k) +
    place_k).

    Attributes:
        pivots: (K, 3) metres, at rest, on the surface.
        edges: (E, 2) int32 pairs of neighbouring transforms.
        skin: the numbers and the weights of four transforms per vertex.
        linear: (F, K, 3, 3) linear maps.
        places: (F, K, 3) positions of the pivots over time, metres.
        axes: (K, 3, 3) stretch axes Q, with linear = R Q diag(s) Q' for a rotation R and scales s. None if
            linear may be any map.
        error: the difference from the solved surface, over all frames.
    """

    pivots: Float
    edges: Int32
    skin: SkinWeights
    linear: Float
    places: Float
    axes: Float | None
    error: BakeError


def bake_surface(
    mesh: Mesh,
    frames: Frames,
    traits: Float,
    held: Sequence[int] = (),
    settings: BakeSettings | None = None,
    shear: bool = False,
) -> BakedSurface:
    """Fits the weights and transforms of a skinned mesh to an animated surface.

    Args:
        mesh: the mesh at rest.
        frames: returns an iterator over the vertices (V, 3) of each frame, in a coordinate frame that moves
            with the whole mesh.
        traits: (F, ...) features that distinguish frames, for example the positions of the control points.
        held: numbers of the vertices at which a transform is always placed.
        shear: True to allow any affine map, as in a deformation graph. False allows only maps that a glTF
            node can represent.
    """
    settings = settings or BakeSettings()
    welded, of = weld(mesh)
    first = np.unique(of, return_index=True)[1]
    chosen = sample_farthest(traits.reshape(len(traits), -1), settings.frames)
    frame_vertices = _gather_frames(frames, chosen, first)
    fit = _Fit(welded, frame_vertices, [int(of[v]) for v in held], settings, shear)
    for _ in range(_MAX_REFITS):
        fit.run()
        missed = WorstFrames(settings.worst * fit.size)
        linear, places, error = _measure_fit(fit, frames, len(traits), first, missed)
        if not missed.frames or not fit.has_room:
            break
        fit.add_frames(missed.frames)
    skin = SkinWeights(fit.indices[of].astype(np.uint16), fit.weights[of].astype(np.float32))
    axes = fit.maps.axes
    return BakedSurface(fit.pivots, fit.seeds.edges(), skin, linear, places, axes, error)


def sample_farthest(traits: Float, count: int) -> Int:
    """Selects ``count`` rows of (F, D) by farthest point sampling, starting with the first. Returns their
    ascending indices (C,)."""
    if len(traits) <= count:
        return np.arange(len(traits))
    chosen = [0]
    squared_distances = ((traits - traits[0]) ** 2).sum(1)
    while len(chosen) < count and squared_distances.max() > 0.0:
        chosen.append(int(np.argmax(squared_distances)))
        squared_distances = np.minimum(squared_distances, ((traits - traits[chosen[-1]]) ** 2).sum(1))
    return np.sort(np.array(chosen))


class WorstFrames:
    """The frames with the largest errors above the tolerance.

    Attributes:
        tolerance: the tolerance in metres.
        frames: the vertices (V, 3) of each recorded frame.
    """

    def __init__(self, tolerance: float) -> None:
        self.tolerance = tolerance
        self._kept: list[tuple[float, Float]] = []

    @property
    def frames(self) -> list[Float]:
        """The recorded frames (V, 3), the one with the largest error first."""
        return [frame for _, frame in self._kept]

    def record(self, worst: float, frame: Float) -> None:
        """Records a frame with a maximum vertex error of ``worst`` metres."""
        if worst > self.tolerance:
            self._kept = sorted([*self._kept, (worst, frame)], key=lambda kept: -kept[0])[:_MAX_FRAMES_ADDED]


class _Fit:
    """The weights and maps during the alternating fit.

    Attributes:
        indices, weights: (V, 4) of the welded mesh.
        seeds: the vertices at which transforms are placed.
        maps: solver for the maps of a frame.
    """

    def __init__(
        self, mesh: Mesh, frame_vertices: Float, held: Sequence[int], settings: BakeSettings, shear: bool
    ) -> None:
        self._rest, self._wanted, self._settings, self._shear = mesh.vertices, frame_vertices, settings, shear
        self._bound = False
        self.size = float(np.linalg.norm(np.ptp(mesh.vertices, axis=0)))
        self._net = EdgeGraph(mesh)
        self._near = self._net.lengths.indices.astype(np.int64)
        self._starts = self._net.lengths.indptr.astype(np.int64)
        count = min(settings.nodes, len(mesh.vertices))
        self.seeds = Seeds(self._net, list(dict.fromkeys(held))[:count], min(settings.first, count))
        self._assign_seeds()

    def run(self) -> None:
        """Fits weights and maps, and adds transforms until the tolerance or the maximum number is reached.

        At first, any affine maps are allowed. Once the tolerance is reached, they are restricted to their
        final form.
        """
        settings = self._settings
        max_transforms = min(settings.nodes, len(self._rest))
        while True:
            self._fit_alternately(settings.rounds)
            error_ratios = self._error_ratios()
            if error_ratios.max() <= 1.0 and not self._shear:
                self._bound = True
                self._fit_maps()
                self._fit_alternately(_FINAL_ROUNDS)
                error_ratios, self._bound = self._error_ratios(), False
            free_count = max_transforms - len(self.pivots)
            if error_ratios.max() <= 1.0 or not self.seeds.grow(
                error_ratios, min(free_count, max(len(self.pivots) // 2, 4))
            ):
                break
            self._assign_seeds()
        if not self._shear and self.maps.axes is None:
            self._bound = True
            self._fit_maps()
            self._fit_alternately(_FINAL_ROUNDS)

    @property
    def has_room(self) -> bool:
        """True if more transforms may be added."""
        return len(self.pivots) < min(self._settings.nodes, len(self._rest))

    def add_frames(self, frames: list[Float]) -> None:
        """Adds frames (V, 3) to the fit."""
        self._wanted = np.concatenate([self._wanted, np.stack(frames, 1)], 1)
        self._fit_maps()

    def _fit_alternately(self, rounds: int) -> None:
        for _ in range(rounds):
            self._fit_weights()
            self._fit_maps()

    def _error_ratios(self) -> Float:
        """Returns (V,) each vertex's error divided by the tolerance. A ratio above 1 exceeds the
        tolerance.
        """
        settings, frames = self._settings, self._wanted.shape[1]
        squares, worst, _ = self.errors(self._found, self._wanted)
        mean_ratio = np.sqrt(squares.mean() / frames) / max(settings.rms * self.size, 1e-300)
        # If the mean error is too large, give ratios above 1 to the vertices with errors above the mean.
        vertex_ratios = (
            mean_ratio * np.sqrt(squares / max(squares.mean(), 1e-300)) if mean_ratio > 1.0 else 0.0 * squares
        )
        return np.asarray(np.maximum(vertex_ratios, np.sqrt(worst) / max(settings.worst * self.size, 1e-300)))

    def _assign_seeds(self) -> None:
        """Assigns each vertex to the nearest seed along the surface."""
        self.pivots = np.ascontiguousarray(self._rest[self.seeds.vertices])
        self._candidates = self.seeds.find_nearest(_CANDIDATE_TRANSFORMS)
        self.indices = np.zeros((len(self._rest), 4), np.int32)
        self.indices[:, 0] = self._candidates[:, 0]
        self.weights = np.zeros((len(self._rest), 4))
        self.weights[:, 0] = 1.0
        self._fit_maps()

    def _fit_maps(self) -> None:
        self.maps = Maps(self._rest, self.pivots, self.indices, self.weights, self._settings.rigid)
        maps = self.maps.solve_maps(self._wanted)
        if self._bound:
            self.maps.find_axes(maps)
            maps = self.maps.solve_maps(self._wanted)
        self._found = maps

    def _fit_weights(self) -> None:
        smooth = self._wanted.shape[1] * (self._settings.smooth * self.size) ** 2
        flat = self._wanted.reshape(len(self._rest), -1)
        by_node = np.ascontiguousarray(self._found.transpose(1, 2, 0, 3)).reshape(len(self.pivots), 4, -1)
        neighbours = self._candidates, self._near, self._starts, smooth
        fit_weights(self._rest, flat, self.pivots, by_node, *neighbours, self.indices, self.weights)

    def errors(self, maps: Float, frame_vertices: Float) -> tuple[Float, Float, Float]:
        """Computes the sum (V,) and the maximum (V,) of each vertex's square errors, and the maximum (F,) of
        each frame."""
        squares, worst = np.zeros(len(self._rest)), np.zeros(len(self._rest))
        skinning = self._rest, self.pivots, self.indices, self.weights
        return squares, worst, add_errors(*skinning, maps, frame_vertices, squares, worst)


def _gather_frames(frames: Frames, chosen: Int, first: Int) -> Float:
    """Returns the vertices (V, C, 3) in the C chosen frames, metres."""
    frame_vertices = np.empty((len(first), len(chosen), 3))
    column = {int(frame): k for k, frame in enumerate(chosen)}
    for number, vertices in enumerate(frames()):
        if number in column:
            frame_vertices[:, column[number]] = vertices[first]
        if number == chosen[-1]:
            break
    return frame_vertices


def _frame_chunks(frames: Frames, first: Int) -> Iterator[Float]:
    """Yields chunks (V, C, 3) of consecutive frames."""
    chunk: list[Float] = []
    for vertices in frames():
        chunk.append(vertices[first])
        if len(chunk) == _CHUNK_FRAMES:
            yield np.stack(chunk, 1)
            chunk = []
    if chunk:
        yield np.stack(chunk, 1)


def _measure_fit(
    fit: _Fit, frames: Frames, count: int, first: Int, missed: WorstFrames
) -> tuple[Float, Float, BakeError]:
    """Computes the transforms of all frames, and the error of the surface."""
    linear, places = np.empty((count, len(fit.pivots), 3, 3)), np.empty((count, len(fit.pivots), 3))
    total, worst, frame, vertex, start = 0.0, 0.0, 0, 0, 0
    for frame_vertices in _frame_chunks(frames, first):
        maps = fit.maps.solve_maps(frame_vertices)
        squares, vertex_worst, of_frame = fit.errors(maps, frame_vertices)
        total += float(squares.sum())
        for number, frame_error in enumerate(np.sqrt(of_frame)):
            missed.record(float(frame_error), frame_vertices[:, number])
        if vertex_worst.max() > worst:
            worst, frame, vertex = (
                float(vertex_worst.max()),
                start + int(of_frame.argmax()),
                int(first[vertex_worst.argmax()]),
            )
        linear[start : start + len(maps)] = maps[:, :, :3].transpose(0, 1, 3, 2)
        places[start : start + len(maps)] = maps[:, :, 3]
        start += len(maps)
    rms = float(np.sqrt(total / (count * len(first))))
    return linear, places, BakeError(rms, float(np.sqrt(worst)), frame, vertex, fit.size)
