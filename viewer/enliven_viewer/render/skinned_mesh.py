"""A character on the GPU. It is skinned once per frame into a buffer, and every render pass draws that
buffer.
"""

from __future__ import annotations

import math
from functools import cached_property
from typing import NamedTuple

import moderngl
import numpy as np

from enliven.arrays import Float, Float32
from enliven.document import Character, Pose
from enliven.meshes import Texture, longest_edge
from enliven_viewer.render.attachment_glow import AttachmentGlow, compute_point_weights
from enliven_viewer.render.gl.program import TEXTURE_UNITS
from enliven_viewer.render.materials.paint import paint_keys, paint_surface
from enliven_viewer.render.materials.parts import Part
from enliven_viewer.render.materials.textures import SharedTexture, Textures
from enliven_viewer.render.normals import make_solved_rows
from enliven_viewer.render.scene import find_corners
from enliven_viewer.render.surface import (
    cluster_faces,
    is_closed,
    order_along_morton_curve,
    split_creases,
)

_TRANSFORMS_PER_ROW = 256
"""Number of transforms in a row of the texture. It must equal the number in shaders/skin.vert."""
_MAX_FINE_EDGE_M = 0.07
"""Maximum edge length in metres of a fine mesh. Such edges are shorter than the detail of soft shadows and
cutaways.
"""
_CONTACT_DETAIL_M = 0.03
"""Cell size in metres of the simplified mesh that is drawn into the contact map."""
_PAINT_ATTRIBUTES = (("in_uv", "4f"), ("in_albedo", "4f"), ("in_finish", "2f"), ("in_emission", "3f"))
"""The attributes of a vertex's paint, in order."""


class DrawnPart(NamedTuple):
    """A part of a mesh on the GPU: the range of its faces, and its textures by name."""

    part: Part
    start: int
    count: int
    textures: dict[str, SharedTexture]


class SkinnedMesh:
    """One character's buffers.

    The transforms are stored in a float texture, which can be far larger than a uniform block in OpenGL 3.3.
    So a graph may have thousands of nodes. Transform feedback stores the skinned vertices for the shadow map,
    the contact map and the image.

    Args:
        character: the character to draw.
        crease: angle in radians above which an edge is sharp.
        skin: the program with ``skin.vert``.
        textures: the context's textures.
    """

    def __init__(
        self,
        ctx: moderngl.Context,
        character: Character,
        crease: float,
        skin: moderngl.Program,
        textures: Textures,
    ) -> None:
        self.character = character
        keys = paint_keys(character)
        self._surface = surface = split_creases(character.vertices, character.faces, crease, keys)
        self.count = len(surface.source)
        rows = math.ceil(len(character.pivots) / _TRANSFORMS_PER_ROW)
        self._staged = np.zeros((rows * _TRANSFORMS_PER_ROW, 3, 4), np.float32)
        self._transforms = ctx.texture((3 * _TRANSFORMS_PER_ROW, rows), 4, dtype="f4")
        self._transforms.filter = (moderngl.NEAREST, moderngl.NEAREST)
        rest_vertices = character.vertices[surface.source].astype("f4")
        self._inputs = [
            ctx.buffer(np.hstack([rest_vertices, surface.normals]).astype("f4").tobytes()),
            ctx.buffer(np.ascontiguousarray(character.skin.indices[surface.source], "u2").tobytes()),
            ctx.buffer(np.ascontiguousarray(character.skin.weights[surface.source], "f4").tobytes()),
        ]
        self.closed = is_closed(character.vertices, character.faces)
        self.fine = (
            self.closed
            and longest_edge(character.vertices.astype(np.float64), character.faces) <= _MAX_FINE_EDGE_M
        )
        paint = paint_surface(character, surface)
        self.parts = tuple(
            DrawnPart(part, start, count, self._acquire_textures(part, textures))
            for part, start, count in paint.parts
        )
        faces = np.concatenate(
            [
                order_along_morton_curve(rest_vertices, surface.faces[paint.order[start : start + count]])
                for _, start, count in paint.parts
            ]
        )
        self._faces = ctx.buffer(faces.tobytes())
        self._coarse_faces = ctx.buffer(cluster_faces(rest_vertices, faces, _CONTACT_DETAIL_M).tobytes())
        self._paint = ctx.buffer(paint.rows.tobytes())
        self._textures = textures
        self._boxes = find_transform_boxes(character)
        self._placed: Float32 | None = None
        self.held = False
        self._held: AttachmentGlow | None = None
        self._light: Float32 = np.zeros((0, 3), np.float32)
        self._skinned = ctx.buffer(reserve=self.count * 24)
        layouts = (("3f 3f", "in_rest", "in_rest_normal"), ("4u2", "in_nodes"), ("4f", "in_weights"))
        content = [(buffer, *layout) for buffer, layout in zip(self._inputs, layouts, strict=True)]
        self._skin = ctx.vertex_array(skin, content)
        self._ctx = ctx
        self._drawn: dict[tuple[int, int], moderngl.VertexArray] = {}

    def skin(self, pose: Pose) -> None:
        """Skins the vertices for a pose of this character."""
        self._placed = None
        matrices = pose.matrices(self.character.pivots)
        self._staged[: len(matrices)] = np.nan_to_num(matrices, posinf=0.0, neginf=0.0)
        self._transforms.write(self._staged)
        self._transforms.use(TEXTURE_UNITS["transforms"])
        self._skin.transform(self._skinned, moderngl.POINTS, vertices=self.count)

    def place(self, vertices: Float32) -> None:
        """Sets the vertices (V, 3), in metres in the world, to the positions computed by a solver."""
        if vertices is not self._placed:
            self._skinned.write(make_solved_rows(vertices, self.character.faces, self._surface))
        self._placed = vertices

    def hull(self) -> Float:
        """Returns (K, 3) points in metres with a convex hull that contains every current vertex.

        A skinned vertex is a convex combination of the positions that its transforms give it separately.
        """
        if self._placed is not None:
            # Replace non-finite coordinates by 0, as render.normals does.
            places = np.where(np.isfinite(self._placed), self._placed, 0.0)
            return find_corners((places.min(0), places.max(0)))
        moved_boxes = self._staged[: len(self._boxes)]
        places = np.einsum("jab,jkb->jka", moved_boxes[:, :, :3], self._boxes) + moved_boxes[:, None, :, 3]
        return np.asarray(places[np.isfinite(self._boxes[:, 0, 0])].reshape(-1, 3), np.float64)

    def render(self, program: moderngl.Program, part: DrawnPart) -> None:
        """Draws the triangles of a part.

        The program uses ``in_position`` and optionally other attributes.
        """
        self._get_array(program, self._faces).render(
            moderngl.TRIANGLES, vertices=3 * part.count, first=3 * part.start
        )

    def render_all(self, program: moderngl.Program, *, coarse: bool = False) -> None:
        """Draws all opaque parts with one program that only uses ``in_position``.

        Args:
            coarse: if True, draw a simplified version of the whole mesh, with details of a few centimetres.
        """
        if self.closed:
            self._ctx.enable(moderngl.CULL_FACE)
        if coarse:
            self._get_array(program, self._coarse_faces).render(moderngl.TRIANGLES)
        else:
            solid = sum(drawn_part.count for drawn_part in self.parts if drawn_part.part.alpha == "OPAQUE")
            self._get_array(program, self._faces).render(moderngl.TRIANGLES, vertices=3 * solid)
        if self.closed:
            self._ctx.disable(moderngl.CULL_FACE)

    def set_glow(self, light: Float32 | None) -> None:
        """Sets the glow (J, 3) on each transform for the following images, or None for no glow."""
        self.held = light is not None
        if light is not None:
            self._held = self._held or AttachmentGlow(self._ctx, len(self.character.pivots))
            self._light = light

    def bind_glow(self) -> None:
        """Binds the glow of the transforms."""
        if self._held is not None:
            self._held.use(self._light)

    @cached_property
    def _glow_buffers(self) -> list[moderngl.Buffer]:
        """Returns buffers for the glow of each drawn vertex: the indices of the transforms that it shows, and
        their weights.
        """
        if self.character.kind != "points":
            return self._inputs[1:]
        reach, source = compute_point_weights(self.character), self._surface.source
        return [self._ctx.buffer(part[source].tobytes()) for part in (reach.indices, reach.weights)]

    def positions(self) -> Float32:
        """Returns (N, 3): the skinned vertices, read back, including copies along creases."""
        return np.frombuffer(self._skinned.read(), np.float32).reshape(-1, 6)[:, :3]

    def normals(self) -> Float32:
        """Returns (N, 3): the skinned unit normals, read back."""
        return np.frombuffer(self._skinned.read(), np.float32).reshape(-1, 6)[:, 3:]

    def release(self) -> None:
        """Frees the GPU memory."""
        buffers = [*self._inputs, self._faces, self._coarse_faces, self._paint, self._skinned]
        for array in (*self._drawn.values(), self._skin):
            array.release()
        for buffer in buffers:
            buffer.release()
        self._transforms.release()
        if self._held is not None:
            self._held.release()
        if self.character.kind == "points" and "_grip" in vars(self):
            for buffer in self._glow_buffers:
                buffer.release()
        for drawn_part in self.parts:
            for name, number, _ in drawn_part.part.maps:
                self._textures.release_texture(self._sources[number], name)

    @property
    def _sources(self) -> tuple[Texture, ...]:
        return () if self.character.materials is None else self.character.materials.textures

    def _acquire_textures(self, part: Part, textures: Textures) -> dict[str, SharedTexture]:
        return {name: textures.acquire_texture(self._sources[number], name) for name, number, _ in part.maps}

    def _get_array(self, program: moderngl.Program, faces: moderngl.Buffer) -> moderngl.VertexArray:
        key = program.glo, faces.glo
        if key not in self._drawn:
            self._drawn[key] = self._create_array(program, faces)
        return self._drawn[key]

    def _create_array(self, program: moderngl.Program, faces: moderngl.Buffer) -> moderngl.VertexArray:
        has_normals = "in_normal" in program
        layout = ("3f 3f", "in_position", "in_normal") if has_normals else ("3f 12x", "in_position")
        content = [(self._skinned, *layout)]
        if "in_nodes" in program:
            content += [
                (self._glow_buffers[0], "4u2", "in_nodes"),
                (self._glow_buffers[1], "4f", "in_weights"),
            ]
        used_attributes = [name for name, _ in _PAINT_ATTRIBUTES if name in program]
        if used_attributes:
            formats = [
                size if name in used_attributes else _make_padding(size) for name, size in _PAINT_ATTRIBUTES
            ]
            content.append((self._paint, " ".join(formats), *used_attributes))
        return self._ctx.vertex_array(program, content, index_buffer=faces, index_element_size=4)


def find_transform_boxes(character: Character) -> Float32:
    """Returns the corners (J, 8, 3) in metres of the rest box around the vertices of each transform.

    The values are NaN for a transform without vertices.
    """
    has_weight = character.skin.weights.reshape(-1) > 0
    nodes = character.skin.indices.reshape(-1)[has_weight]
    order = np.argsort(nodes, kind="stable")
    vertices = np.repeat(character.vertices, character.skin.weights.shape[1], axis=0)[has_weight][order]
    used_nodes, starts = np.unique(nodes[order], return_index=True)
    boxes = np.full((len(character.pivots), 8, 3), np.nan, np.float32)
    lows, highs = np.minimum.reduceat(vertices, starts), np.maximum.reduceat(vertices, starts)
    boxes[used_nodes] = [find_corners((low, high)) for low, high in zip(lows, highs, strict=True)]
    return boxes


def _make_padding(size: str) -> str:
    """Returns the padding in moderngl's buffer format for floats that a program does not use."""
    return f"{4 * int(size[0])}x"
