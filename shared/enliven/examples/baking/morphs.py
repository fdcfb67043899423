"""Converts a solved surface to morph targets (blend shapes): shapes that are summed with the weights of each
frame.

The targets are the principal components of the frames that differ most. The required error determines their
number. A rotation is not a sum of shapes, so large rotations need many targets. For large rotations,
transforms (:mod:`enliven.examples.baking.bake`) need less data.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from enliven.arrays import Float
from enliven.examples.baking.bake import Frames, WorstFrames, sample_farthest
from enliven.examples.baking.settings import BakeError, BakeSettings
from enliven.meshes import Mesh

_MAX_REFITS = 4
"""Maximum number of times that frames with too large errors are added to the chosen ones."""
_NORMAL_REGULARIZATION = 1e-4
"""Regularization of the fit of the normals' changes, relative to the size of the targets."""


@dataclass(frozen=True, eq=False)
class BakedMorphs:
    """Shapes and their weights: x = rest + sum_n weights_n targets_n.

    Attributes:
        targets: (N, V, 3) metres.
        normals: (N, V, 3) the change of the vertex normals per unit weight of each target.
        weights: (F, N) the weights of the targets in each frame, about -2 to 2.
        error: the difference from the solved surface, over all frames.
    """

    targets: Float
    normals: Float
    weights: Float
    error: BakeError


def bake_morphs(
    mesh: Mesh, frames: Frames, traits: Float, settings: BakeSettings | None = None
) -> BakedMorphs:
    """Fits morph targets to a surface; see :func:`enliven.examples.baking.bake.bake_surface`."""
    settings = settings or BakeSettings()
    size = float(np.linalg.norm(np.ptp(mesh.vertices, axis=0)))
    chosen = sample_farthest(traits.reshape(len(traits), -1), settings.frames)
    displacements, normals = _gather_displacements(mesh, frames, chosen.tolist())
    for _ in range(_MAX_REFITS):
        shapes, spread = _compute_principal_components(displacements, settings.targets)
        count = _find_needed_shapes(displacements, shapes, settings, size)
        shapes, spread = shapes[:count], spread[:count]
        missed = WorstFrames(settings.worst * size)
        weights, error = _measure_weights(mesh, frames, len(traits), shapes, size, missed)
        if not missed.frames or count == settings.targets:
            break
        more_displacements = [_vertex_displacements(mesh, vertices) for vertices in missed.frames]
        displacements = np.concatenate([displacements, [vertices for vertices, _ in more_displacements]])
        normals = np.concatenate([normals, [vertex_normals for _, vertex_normals in more_displacements]])
    moved_weights = displacements @ shapes.T / spread
    square = moved_weights.T @ moved_weights + _NORMAL_REGULARIZATION * len(moved_weights) * np.eye(count)
    normal_shapes = np.asarray(np.linalg.solve(square, moved_weights.T @ normals), np.float64)
    frame_shape = (count, len(mesh.vertices), 3)
    targets = (shapes * spread[:, None]).reshape(frame_shape)
    return BakedMorphs(targets, normal_shapes.reshape(frame_shape), weights / spread, error)


def _gather_displacements(mesh: Mesh, frames: Frames, chosen: list[int]) -> tuple[Float, Float]:
    """Returns the vertices' displacements (C, 3 V) from rest in the chosen frames, and the changes of their
    normals (C, 3 V).
    """
    displacements, normals = (
        np.empty((len(chosen), mesh.vertices.size)),
        np.empty((len(chosen), mesh.vertices.size)),
    )
    row = {frame: k for k, frame in enumerate(chosen)}
    for number, vertices in enumerate(frames()):
        if number in row:
            displacements[row[number]], normals[row[number]] = _vertex_displacements(mesh, vertices)
        if number == chosen[-1]:
            break
    return displacements, normals


def _vertex_displacements(mesh: Mesh, vertices: Float) -> tuple[Float, Float]:
    """Returns the displacements (3 V,) of vertices (V, 3) from rest, and the changes of their normals (3
    V,)."""
    moved_normals = Mesh(vertices, mesh.faces, mesh.name).vertex_normals() - mesh.vertex_normals()
    return (vertices - mesh.vertices).ravel(), moved_normals.ravel()


def _compute_principal_components(moved: Float, max_count: int) -> tuple[Float, Float]:
    """Returns the principal components (N, 3 V) of C displacements (C, 3 V), largest first, and their
    standard deviations (N,).
    """
    values, vectors = np.linalg.eigh(moved @ moved.T)
    order = np.argsort(values)[::-1][:max_count]
    order = order[values[order] > 1e-12 * max(float(values.max()), 1e-300)]
    if not len(order):
        order = np.array([len(values) - 1])
    shapes = vectors[:, order].T @ moved
    length = np.linalg.norm(shapes, axis=1, keepdims=True)
    # Orthogonalize again, because eigenvectors with small eigenvalues are not orthogonal to full precision.
    shapes = np.linalg.qr((shapes / np.where(length > 0, length, 1.0)).T)[0].T
    spread = np.sqrt(((moved @ shapes.T) ** 2).mean(0))
    return shapes, np.where(spread > 0, spread, 1.0)


def _find_needed_shapes(moved: Float, shapes: Float, settings: BakeSettings, size: float) -> int:
    """Returns the number of shapes that suffice for frames ``moved`` (C, 3 V), or the number of all shapes if
    none suffices."""
    residual = moved.copy()
    for count, shape in enumerate(shapes, 1):
        residual -= np.outer(residual @ shape, shape)
        squared_errors = (residual.reshape(len(residual), -1, 3) ** 2).sum(2)
        if (
            np.sqrt(squared_errors.mean()) <= settings.rms * size
            and np.sqrt(squared_errors.max()) <= settings.worst * size
        ):
            return count
    return len(shapes)


def _measure_weights(
    mesh: Mesh, frames: Frames, count: int, shapes: Float, size: float, missed: WorstFrames
) -> tuple[Float, BakeError]:
    """Returns (F, N) weights of all frames, and the error of the surface."""
    weights, total, worst, worst_frame, vertex = np.empty((count, len(shapes))), 0.0, 0.0, 0, 0
    for number, vertices in enumerate(frames()):
        displacements = (vertices - mesh.vertices).ravel()
        weights[number] = shapes @ displacements
        squared_errors = ((displacements - weights[number] @ shapes).reshape(-1, 3) ** 2).sum(1)
        total += float(squared_errors.mean())
        missed.record(float(np.sqrt(squared_errors.max())), vertices)
        if squared_errors.max() > worst:
            worst, worst_frame, vertex = float(squared_errors.max()), number, int(squared_errors.argmax())
    return weights, BakeError(float(np.sqrt(total / count)), float(np.sqrt(worst)), worst_frame, vertex, size)
