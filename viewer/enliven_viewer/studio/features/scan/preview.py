"""The preview surface of a running scan. It is assembled from the blocks that the edge sends, and drawn.
Areas with few observations are hatched.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import moderngl
import numpy as np

from enliven.arrays import Float, Float32, Int32, UInt8
from enliven.meshes import Mesh
from enliven.wire import ScanPieceMessage
from enliven_viewer.render.gl.program import load_program
from enliven_viewer.render.gl.targets import RenderTarget
from enliven_viewer.studio.viewport.viewport import RenderPass
from enliven_viewer.theme import PLAIN_SURFACE, WAIT


@dataclass(frozen=True, eq=False)
class ScanPreview:
    """The vertices and faces of a preview surface.

    Attributes:
        vertices: (V, 3) metres in the scan's world.
        normals: (V, 3) unit normals.
        colours: (V, 3) uint8 sRGB.
        seen: (V,) uint8 observation quality; 255 is best.
        faces: (F, 3) int32.
    """

    vertices: Float32
    normals: Float32
    colours: UInt8
    seen: UInt8
    faces: Int32


class ScanPreviewMesh:
    """The newest version of every block of the scan, joined into one surface.

    Attributes:
        picture: the surface to draw, in the scan's world; None if there is none. A change creates a new
            object.
    """

    def __init__(self) -> None:
        self._pieces: dict[str, ScanPieceMessage] = {}
        self.picture: ScanPreview | None = None

    def update(self, newest: Mapping[str, ScanPieceMessage], number: int) -> bool:
        """Updates the surface from the newest message of each block of scan ``number``. Returns True if
        anything has changed.
        """
        pieces = {key: piece for key, piece in newest.items() if piece.number == number and piece.seen}
        same = len(pieces) == len(self._pieces)
        if same and all(self._pieces.get(key) is piece for key, piece in pieces.items()):
            return False
        self._pieces = pieces
        self.picture = _join_pieces(list(pieces.values())) if pieces else None
        return True

    @property
    def bounds(self) -> Float | None:
        """Returns the bounding box without outliers, (2, 3) in metres of the scan's world, or None without a
        surface.
        """
        if self.picture is None:
            return None
        return np.asarray(np.quantile(self.picture.vertices, [0.02, 0.98], axis=0), float)


def _join_pieces(pieces: list[ScanPieceMessage]) -> ScanPreview:
    """Returns the blocks joined into one surface with smooth shading across block borders."""
    vertices: list[Float32] = []
    faces: list[Int32] = []
    colours: list[UInt8] = []
    count = 0
    for piece in pieces:
        steps = np.frombuffer(piece.vertices, "<u2").reshape(-1, 3)
        piece_faces = np.frombuffer(piece.faces, "<u2").reshape(-1, 3).astype(np.int32)
        piece_faces = piece_faces[(piece_faces < len(steps)).all(1)]
        vertices.append((steps + np.array(piece.place, float) * piece.side).astype(np.float32) * piece.step)
        faces.append(piece_faces + count)
        piece_colours = np.frombuffer(piece.colours, np.uint8).reshape(-1, 3)
        colours.append(
            piece_colours
            if len(piece_colours)
            else np.tile(np.array(PLAIN_SURFACE, np.uint8), (len(steps), 1))
        )
        count += len(steps)
    points, joined = np.concatenate(vertices), np.concatenate(faces)
    seen = np.concatenate([np.frombuffer(piece.seen, np.uint8) for piece in pieces])
    return ScanPreview(points, _compute_normals(points, joined), np.concatenate(colours), seen, joined)


def _compute_normals(vertices: Float32, faces: Int32) -> Float32:
    """Returns (V, 3) unit normals. Coincident vertices of adjacent blocks share one normal."""
    _, place = np.unique(np.round(vertices * 1e4).astype(np.int64), axis=0, return_inverse=True)
    place = place.reshape(-1)
    whole = Mesh(vertices.astype(float), faces).face_vectors()
    total = np.zeros((int(place.max(initial=-1)) + 1, 3))
    for axis in range(3):
        for corner in range(3):
            total[:, axis] += np.bincount(place[faces[:, corner]], whole[:, axis], len(total))
    lengths = np.maximum(np.linalg.norm(total, axis=1, keepdims=True), 1e-30)
    return np.asarray((total / lengths)[place], np.float32)


class ScanPreviewPass(RenderPass):
    """A render pass that draws over the last image of a renderer, with the same camera and depth buffer.

    Args:
        ctx: the renderer's context.
        find_surface: returns the surface and its (4, 4) transform to the stage; None without a surface.
    """

    def __init__(
        self, ctx: moderngl.Context, find_surface: Callable[[], tuple[ScanPreview, Float] | None]
    ) -> None:
        self._ctx, self._find_surface = ctx, find_surface
        self._program: moderngl.Program | None = None
        self._shown: ScanPreview | None = None
        self._buffers: list[moderngl.Buffer] = []
        self._array: moderngl.VertexArray | None = None

    def draw(self, picture: RenderTarget) -> None:
        """Draws the surface and resolves the image. Without a surface, frees its GPU memory."""
        surface = self._find_surface()
        if surface is None:
            self.release()
            return
        shown, world_from_own = surface
        program = self._program = self._program or load_program(self._ctx, "scan.vert", "scan.frag")
        self._load(shown, program)
        if self._array is None:
            return
        picture.allow_whole_image()
        self._ctx.enable_only(moderngl.DEPTH_TEST)
        self._ctx.depth_func = "<="
        picture.write_depth(True)
        program["world_from_own"] = tuple(np.asarray(world_from_own, float).T.ravel())
        program["hatch"] = WAIT[:3]
        self._array.render(moderngl.TRIANGLES)
        picture.resolve()

    def release(self) -> None:
        """Frees the GPU memory."""
        if self._array is not None:
            self._array.release()
        for buffer in self._buffers:
            buffer.release()
        self._array, self._buffers, self._shown = None, [], None

    def _load(self, shown: ScanPreview, program: moderngl.Program) -> None:
        """Uploads a surface to the GPU. The same surface is not uploaded again."""
        if shown is self._shown:
            return
        self.release()
        self._shown = shown
        if not len(shown.faces):
            return
        tints = np.concatenate([shown.colours, shown.seen[:, None]], 1)
        data = (shown.vertices.astype("f4"), shown.normals.astype("f4"), tints, shown.faces.astype("i4"))
        places, normals, colours, order = (self._ctx.buffer(np.ascontiguousarray(values)) for values in data)
        self._buffers = [places, normals, colours, order]
        self._array = self._ctx.vertex_array(
            program,
            [(places, "3f", "in_position"), (normals, "3f", "in_normal"), (colours, "4f1", "in_tint")],
            index_buffer=order,
            index_element_size=4,
        )
