"""Loose boxes and balls: instances of two templates, lit and shadowed like everything else."""

from __future__ import annotations

import moderngl
import numpy as np

from enliven.arrays import Float, Float32, Int, Int32
from enliven.document import BALL, BOX, Props
from enliven_viewer.render.materials.paint import linear_from_srgb

_BEVEL_FRACTION = 0.07
"""Bevel of a box's edges as a fraction of its smallest half edge. The bevels show highlights."""
_MAX_BEVEL_M = 0.012
"""Maximum bevel in metres, so that a large box still looks like a box."""
_TEMPLATE_POINTS = {BOX: 2, BALL: 6}
"""Number of points from the centre of a template's side to its edge, by shape."""


def make_prop_rows(props: Props | None, shape: int) -> Float32:
    """Returns (N, 14) float32 rows of one shape.

    A row has xyz and bevel, rotation (x, y, z, w), half edges, and linear rgb.
    """
    if props is None:
        return np.zeros((0, 14), np.float32)
    is_drawn = (props.shapes == shape) & np.isfinite(props.positions).all(1)
    half_sizes = np.asarray(props.sizes[is_drawn], np.float64)
    rows = np.empty((int(is_drawn.sum()), 14), np.float32)
    rows[:, :3] = props.positions[is_drawn]
    rows[:, 3] = (
        half_sizes[:, 0]
        if shape == BALL
        else np.minimum(_BEVEL_FRACTION * half_sizes.min(1, initial=np.inf), _MAX_BEVEL_M)
    )
    rows[:, 4:8] = np.roll(props.turns[is_drawn], -1, 1)
    rows[:, 8:11] = half_sizes
    rows[:, 11:] = linear_from_srgb(props.colours[is_drawn])
    return rows


class PropPass:
    """The props of a scene on the GPU, for one program.

    Args:
        program: a program with ``prop.vert``.
    """

    def __init__(self, ctx: moderngl.Context, program: moderngl.Program) -> None:
        self._rows = {shape: ctx.buffer(reserve=14 * 4 * 64, dynamic=True) for shape in _TEMPLATE_POINTS}
        self._counts = dict.fromkeys(_TEMPLATE_POINTS, 0)
        self._arrays = {}
        for shape, fineness in _TEMPLATE_POINTS.items():
            vertices, faces = make_block_template(fineness)
            names = [n for n in ("in_place", "in_turn", "in_half", "in_albedo") if n in program]
            sizes = {"in_place": "4f", "in_turn": "4f", "in_half": "3f", "in_albedo": "3f"}
            # Skip attributes that the program does not use: a shadow has no colour.
            padding = "" if "in_albedo" in program else " 12x"
            layout = " ".join(sizes[n] for n in names) + padding + "/i"
            points = "3f 3f" if "in_direction" in program else "12x 3f"
            self._arrays[shape] = ctx.vertex_array(
                program,
                [
                    (ctx.buffer(vertices.tobytes()), points, "in_direction", "in_corner"),
                    (self._rows[shape], layout, *names),
                ],
                index_buffer=ctx.buffer(faces.tobytes()),
                index_element_size=4,
            )

    def load(self, props: Props | None) -> None:
        """Uploads the props. None uploads none."""
        for shape, buffer in self._rows.items():
            rows = make_prop_rows(props, shape)
            self._counts[shape] = len(rows)
            if len(rows):
                buffer.orphan(rows.nbytes)
                buffer.write(rows)

    def render(self) -> None:
        """Draws the loaded rows."""
        for shape, array in self._arrays.items():
            if self._counts[shape]:
                array.render(moderngl.TRIANGLES, instances=self._counts[shape])


def make_block_template(fineness: int) -> tuple[Float32, Int32]:
    """Returns (N, 6) unit directions with their corners (-1 or 1 along each axis), and (F, 3) faces.

    The template is a sphere made of a cube's six sides, with ``2 fineness`` points along each. Its eight
    octants are separate. The shader moves the octants apart, and the gaps become the flat sides of a box.
    """
    half_grid = np.tan(np.linspace(0.0, np.pi / 4, fineness))
    grid = np.concatenate([-half_grid[::-1], half_grid])
    corner = np.concatenate([-np.ones(fineness), np.ones(fineness)])
    count = 2 * fineness
    u, v = np.meshgrid(grid, grid, indexing="ij")
    cu, cv = np.meshgrid(corner, corner, indexing="ij")
    i, j = np.meshgrid(np.arange(count - 1), np.arange(count - 1), indexing="ij")
    a, b = (i * count + j).ravel(), ((i + 1) * count + j).ravel()
    quads = np.concatenate([np.stack([a, b, b + 1], 1), np.stack([a, b + 1, a + 1], 1)])
    rows: list[Float] = []
    faces: list[Int] = []
    for axis in range(3):
        for side in (-1.0, 1.0):
            direction, corners = np.empty((count * count, 3)), np.empty((count * count, 3))
            for put, values in ((direction, (u, v, side)), (corners, (cu, cv, side))):
                put[:, (axis + 1) % 3], put[:, (axis + 2) % 3] = values[0].ravel(), values[1].ravel()
                put[:, axis] = values[2]
            direction /= np.linalg.norm(direction, axis=1, keepdims=True)
            faces.append(len(rows) * count * count + (quads if side > 0 else quads[:, ::-1]))
            rows.append(np.concatenate([direction, corners], 1))
    return np.concatenate(rows).astype(np.float32), np.concatenate(faces).astype(np.int32)
