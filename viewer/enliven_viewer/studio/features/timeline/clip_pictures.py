"""Thumbnails of the poses of takes, shown in timeline clips. They are drawn in the background and cached."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from weakref import WeakKeyDictionary

import numpy as np

from enliven.arrays import AnyArray, Float, Int32, UInt8
from enliven.document import Clip, GraphCharacter, PoseStream, Project, joint_places

POSE_COUNT = 64
"""Number of poses in a take's sheet. They are evenly spaced over the take."""
SHEET_COLUMNS = 8
"""Number of tiles in a row of the sheet."""
TILE_SIZE = 48
"""Width and height of a tile in pixels: twice the lane height, for high-resolution screens."""
_FIGURE_FRACTION = 0.9
"""Fraction of a tile that the take's largest pose fills."""
_MAX_LINES = 400
"""Maximum number of lines in a figure. A mesh with more edges shows a subset."""
_THICK_HALF_WIDTH_PX = 1.6
"""Half of the line width, in pixels, of a figure with few lines."""
_THIN_HALF_WIDTH_PX = 0.45
"""Half of the line width, in pixels, of a figure with many lines. Thicker lines would merge."""
_MIN_THIN_LINES = 60
"""Figures with at least this number of lines have thin lines. A performer has about twenty bones."""


class ClipPictures:
    """Sheets of :data:`POSE_COUNT` figures of a take, white on a transparent background.

    They range from its first to its last frame.
    """

    def __init__(self) -> None:
        self._pool: ThreadPoolExecutor | None = None
        self._sheets: WeakKeyDictionary[object, Future[UInt8]] = WeakKeyDictionary()

    def sheet(self, project: Project, take: Clip | PoseStream) -> UInt8 | None:
        """Returns the (R, C, 4) uint8 pixels, upper row first, or None until the sheet has been drawn."""
        future = self._sheets.get(take)
        if future is None:
            self._pool = self._pool or ThreadPoolExecutor(1, "pictures of clips")
            work = _make_figure_function(project, take)
            future = self._sheets[take] = self._pool.submit(lambda: draw_sheet(*work()))
        return future.result() if future.done() and future.exception() is None else None

    def finish(self) -> None:
        """Waits until all sheets have been drawn."""
        for future in list(self._sheets.values()):
            future.exception()


def _make_figure_function(project: Project, take: Clip | PoseStream) -> Callable[[], tuple[Float, AnyArray]]:
    """Returns a thread-safe function that computes a take's figures as points (P, N, 3) in metres and lines
    (L, 2) of point indices.
    """
    if isinstance(take, Clip):
        return lambda: (_find_joints(take, _choose_frames(len(take.turns))), _list_bones(take))
    shapes = project.select_kind(GraphCharacter).values()
    parts = [(shape, part.nodes, part.take) for shape in shapes for part in shape.parts]
    parts += [(shape, layer.own, layer.take) for shape in shapes for layer in shape.over]
    edges = next((_find_edges(shape, nodes) for shape, nodes, name in parts if name == take.id), None)
    frames = _choose_frames(len(take.positions))
    return lambda: (take.positions[frames], np.zeros((0, 2), np.int32) if edges is None else edges)


def _choose_frames(count: int) -> Int32:
    """Returns the frames (P,) shown in the sheet."""
    return np.linspace(0, count - 1, POSE_COUNT).round().astype(np.int32)


def _find_joints(take: Clip, frames: Int32) -> Float:
    """Returns the joint positions (P, N, 3) in metres of a take at the given frames."""
    return joint_places(take.map_values(lambda track: track[frames]))


def _list_bones(take: Clip) -> AnyArray:
    parents = np.asarray(take.skeleton.parents)
    return np.stack([parents[1:], np.arange(1, len(parents))], 1)


def _find_edges(shape: GraphCharacter, nodes: AnyArray) -> AnyArray:
    """Returns lines (L, 2) between nodes for the edges of the shape. Omits edges of nodes that the stream
    lacks, and some edges if there are more than ``_MAX_LINES``.
    """
    inside = (shape.edges < len(nodes)).all(1)
    lines = np.asarray(nodes)[shape.edges[inside]]
    return lines[:: max(len(lines) // _MAX_LINES, 1)]


def draw_sheet(points: Float, lines: AnyArray) -> UInt8:
    """Returns the (R, C, 4) sheet of figures with points (P, N, 3) in metres.

    Each is centred and seen from the front.
    """
    flat = np.stack([points[..., 0], -points[..., 1]], -1)
    # Centre each figure horizontally. All figures have the same scale and the same floor.
    low, high = flat.min(1), flat.max(1)
    width = max(float((high[:, 0] - low[:, 0]).max()), 1e-6)
    height = max(float(flat[..., 1].max() - flat[..., 1].min()), 1e-6)
    scale = _FIGURE_FRACTION * TILE_SIZE / max(width, height)
    middle = np.stack([(low[:, 0] + high[:, 0]) / 2, np.full(len(flat), flat[..., 1].max() - height / 2)], 1)
    flat = (flat - middle[:, None]) * scale + TILE_SIZE / 2
    tiles = np.stack([_draw_figure(figure, lines) for figure in flat])
    rows = tiles.reshape(POSE_COUNT // SHEET_COLUMNS, SHEET_COLUMNS, TILE_SIZE, TILE_SIZE).transpose(
        0, 2, 1, 3
    )
    sheet = np.full((*rows.reshape(-1, SHEET_COLUMNS * TILE_SIZE).shape, 4), 255, np.uint8)
    sheet[..., 3] = rows.reshape(-1, SHEET_COLUMNS * TILE_SIZE)
    return sheet


def _draw_figure(points: Float, lines: AnyArray) -> UInt8:
    """Returns the (TILE, TILE) opacity of lines (L, 2) between points (N, 2) pixels.

    Points without lines become dots.
    """
    if not len(lines):
        lines = np.stack([np.arange(len(points))] * 2, 1)
    across = np.arange(TILE_SIZE) + 0.5
    pixels = np.stack(np.meshgrid(across, across), -1).reshape(-1, 1, 2)
    start, line_vectors = points[lines[:, 0]], points[lines[:, 1]] - points[lines[:, 0]]
    fraction_along = ((pixels - start) * line_vectors).sum(-1) / np.maximum((line_vectors**2).sum(-1), 1e-12)
    nearest = start + np.clip(fraction_along, 0.0, 1.0)[..., None] * line_vectors
    distances = np.sqrt(((pixels - nearest) ** 2).sum(-1)).min(1)
    half = _THICK_HALF_WIDTH_PX if len(lines) < _MIN_THIN_LINES else _THIN_HALF_WIDTH_PX
    return np.asarray(255 * np.clip(half + 0.5 - distances, 0.0, 1.0), np.uint8).reshape(TILE_SIZE, TILE_SIZE)
