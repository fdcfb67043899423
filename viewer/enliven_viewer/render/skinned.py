"""A character on the GPU: skinned once a frame into a buffer that every pass then draws from."""

from __future__ import annotations

import math
from functools import cached_property
from typing import NamedTuple

import moderngl
import numpy as np

from enliven.arrays import Float, Float32
from enliven.document import Character, Pose
from enliven.meshes import Texture, longest_edge
from enliven_viewer.render.gl import UNITS
from enliven_viewer.render.held import HeldLight, reach_of_points
from enliven_viewer.render.materials import HeldTexture, Part, Textures, paint_keys, painted
from enliven_viewer.render.normals import solved_rows
from enliven_viewer.render.scene import corners
from enliven_viewer.render.surface import (
    clustered_faces,
    is_closed,
    neighbours_in_turn,
    split_creases,
)

_PER_ROW = 256
"""Transforms in a row of the texture; shaders/skin.vert has the same number."""
_FINE = 0.07
"""Metres: edges up to this are shorter than what a soft shadow or a transparent zone shows."""
_COARSE = 0.03
"""Metres: detail of what is drawn for the contact map."""
_PAINT = (("in_uv", "4f"), ("in_albedo", "4f"), ("in_finish", "2f"), ("in_emission", "3f"))
"""The columns of a vertex's paint, in order."""


class DrawnPart(NamedTuple):
    """A part of a mesh on the GPU: its faces by their first and number, and its textures by their names."""

    part: Part
    start: int
    count: int
    textures: dict[str, HeldTexture]


class SkinnedMesh:
    """One character's buffers.

    The transforms travel in a float texture, which OpenGL 3.3 lets be far larger than a uniform block, so
    that a graph may have thousands of nodes. Transform feedback keeps the skinned vertices for the shadow,
    the contact map and the picture alike.

    Args:
        character: what to draw.
        crease: radians beyond which an edge is sharp.
        skin: the program of ``skin.vert``.
        textures: those of the context.
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
        rows = math.ceil(len(character.pivots) / _PER_ROW)
        self._staged = np.zeros((rows * _PER_ROW, 3, 4), np.float32)
        self._transforms = ctx.texture((3 * _PER_ROW, rows), 4, dtype="f4")
        self._transforms.filter = (moderngl.NEAREST, moderngl.NEAREST)
        rest = character.vertices[surface.source].astype("f4")
        self._inputs = [
            ctx.buffer(np.hstack([rest, surface.normals]).astype("f4").tobytes()),
            ctx.buffer(np.ascontiguousarray(character.skin.indices[surface.source], "u2").tobytes()),
            ctx.buffer(np.ascontiguousarray(character.skin.weights[surface.source], "f4").tobytes()),
        ]
        self.closed = is_closed(character.vertices, character.faces)
        self.fine = (
            self.closed and longest_edge(character.vertices.astype(np.float64), character.faces) <= _FINE
        )
        paint = painted(character, surface)
        self.parts = tuple(
            DrawnPart(part, start, count, self._take(part, textures)) for part, start, count in paint.parts
        )
        faces = np.concatenate(
            [
                neighbours_in_turn(rest, surface.faces[paint.order[start : start + count]])
                for _, start, count in paint.parts
            ]
        )
        self._faces = ctx.buffer(faces.tobytes())
        self._coarse_faces = ctx.buffer(clustered_faces(rest, faces, _COARSE).tobytes())
        self._paint = ctx.buffer(paint.rows.tobytes())
        self._textures = textures
        self._boxes = boxes_of(character)
        self._placed: Float32 | None = None
        self.held = False
        self._held: HeldLight | None = None
        self._light: Float32 = np.zeros((0, 3), np.float32)
        self._skinned = ctx.buffer(reserve=self.count * 24)
        layouts = (("3f 3f", "in_rest", "in_rest_normal"), ("4u2", "in_nodes"), ("4f", "in_weights"))
        content = [(buffer, *layout) for buffer, layout in zip(self._inputs, layouts, strict=True)]
        self._skin = ctx.vertex_array(skin, content)
        self._ctx = ctx
        self._drawn: dict[tuple[int, int], moderngl.VertexArray] = {}

    def skin(self, pose: Pose) -> None:
        """Moves the vertices into a pose of this character."""
        self._placed = None
        matrices = pose.matrices(self.character.pivots)
        self._staged[: len(matrices)] = np.nan_to_num(matrices, posinf=0.0, neginf=0.0)
        self._transforms.write(self._staged)
        self._transforms.use(UNITS["transforms"])
        self._skin.transform(self._skinned, moderngl.POINTS, vertices=self.count)

    def place(self, vertices: Float32) -> None:
        """Puts the vertices (V, 3), metres in the world, where a solver put them."""
        if vertices is not self._placed:
            self._skinned.write(solved_rows(vertices, self.character.faces, self._surface))
        self._placed = vertices

    def hull(self) -> Float:
        """Returns (K, 3) metres, points that hold every vertex between them where it is now.

        A skinned vertex lies between the places to which each of its transforms alone would move it.
        """
        if self._placed is not None:
            places = np.where(np.isfinite(self._placed), self._placed, 0.0)  # as normals.placed puts them
            return corners((places.min(0), places.max(0)))
        moved = self._staged[: len(self._boxes)]
        places = np.einsum("jab,jkb->jka", moved[:, :, :3], self._boxes) + moved[:, None, :, 3]
        return np.asarray(places[np.isfinite(self._boxes[:, 0, 0])].reshape(-1, 3), np.float64)

    def render(self, program: moderngl.Program, part: DrawnPart) -> None:
        """Draws the triangles of a part with a program that takes ``in_position`` and perhaps more."""
        self._array(program, self._faces).render(
            moderngl.TRIANGLES, vertices=3 * part.count, first=3 * part.start
        )

    def render_all(self, program: moderngl.Program, *, coarse: bool = False) -> None:
        """Draws whatever is solid with one program that takes ``in_position`` alone.

        Args:
            coarse: draw a few centimetres' detail only, and all of it.
        """
        if self.closed:
            self._ctx.enable(moderngl.CULL_FACE)
        if coarse:
            self._array(program, self._coarse_faces).render(moderngl.TRIANGLES)
        else:
            solid = sum(each.count for each in self.parts if each.part.alpha == "OPAQUE")
            self._array(program, self._faces).render(moderngl.TRIANGLES, vertices=3 * solid)
        if self.closed:
            self._ctx.disable(moderngl.CULL_FACE)

    def hold(self, light: Float32 | None) -> None:
        """Sets the light (J, 3) on each transform for the pictures from here on; None for no light."""
        self.held = light is not None
        if light is not None:
            self._held = self._held or HeldLight(self._ctx, len(self.character.pivots))
            self._light = light

    def use_hold(self) -> None:
        """Binds the light on the transforms."""
        if self._held is not None:
            self._held.use(self._light)

    @cached_property
    def _grip(self) -> list[moderngl.Buffer]:
        """Returns which transforms light each drawn vertex, and how much."""
        if self.character.kind != "points":
            return self._inputs[1:]
        reach, source = reach_of_points(self.character), self._surface.source
        return [self._ctx.buffer(part[source].tobytes()) for part in (reach.indices, reach.weights)]

    def positions(self) -> Float32:
        """Returns (N, 3) the skinned vertices, read back; copies along creases included."""
        return np.frombuffer(self._skinned.read(), np.float32).reshape(-1, 6)[:, :3]

    def normals(self) -> Float32:
        """Returns (N, 3) the skinned unit normals, read back."""
        return np.frombuffer(self._skinned.read(), np.float32).reshape(-1, 6)[:, 3:]

    def release(self) -> None:
        """Gives the GPU's memory back."""
        buffers = [*self._inputs, self._faces, self._coarse_faces, self._paint, self._skinned]
        for array in (*self._drawn.values(), self._skin):
            array.release()
        for buffer in buffers:
            buffer.release()
        self._transforms.release()
        if self._held is not None:
            self._held.release()
        if self.character.kind == "points" and "_grip" in vars(self):
            for buffer in self._grip:
                buffer.release()
        for each in self.parts:
            for name, number, _ in each.part.maps:
                self._textures.give_back(self._sources[number], name)

    @property
    def _sources(self) -> tuple[Texture, ...]:
        return () if self.character.materials is None else self.character.materials.textures

    def _take(self, part: Part, textures: Textures) -> dict[str, HeldTexture]:
        return {name: textures.take(self._sources[number], name) for name, number, _ in part.maps}

    def _array(self, program: moderngl.Program, faces: moderngl.Buffer) -> moderngl.VertexArray:
        key = program.glo, faces.glo
        if key not in self._drawn:
            self._drawn[key] = self._array_for(program, faces)
        return self._drawn[key]

    def _array_for(self, program: moderngl.Program, faces: moderngl.Buffer) -> moderngl.VertexArray:
        whole = "in_normal" in program
        layout = ("3f 3f", "in_position", "in_normal") if whole else ("3f 12x", "in_position")
        content = [(self._skinned, *layout)]
        if "in_nodes" in program:
            content += [(self._grip[0], "4u2", "in_nodes"), (self._grip[1], "4f", "in_weights")]
        named = [name for name, _ in _PAINT if name in program]
        if named:
            formats = [size if name in named else _skipped(size) for name, size in _PAINT]
            content.append((self._paint, " ".join(formats), *named))
        return self._ctx.vertex_array(program, content, index_buffer=faces, index_element_size=4)


def boxes_of(character: Character) -> Float32:
    """Returns (J, 8, 3) metres: the corners of the box at rest around what each transform moves; NaN for
    nothing.
    """
    moves = character.skin.weights.reshape(-1) > 0
    nodes = character.skin.indices.reshape(-1)[moves]
    order = np.argsort(nodes, kind="stable")
    vertices = np.repeat(character.vertices, character.skin.weights.shape[1], axis=0)[moves][order]
    used, starts = np.unique(nodes[order], return_index=True)
    boxes = np.full((len(character.pivots), 8, 3), np.nan, np.float32)
    lows, highs = np.minimum.reduceat(vertices, starts), np.maximum.reduceat(vertices, starts)
    boxes[used] = [corners((low, high)) for low, high in zip(lows, highs, strict=True)]
    return boxes


def _skipped(size: str) -> str:
    """Returns the padding in place of floats that a program does not take."""
    return f"{4 * int(size[0])}x"
