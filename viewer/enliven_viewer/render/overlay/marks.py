"""Glowing attachment points, and the nodes and edges of deformation graphs."""

from __future__ import annotations

from collections.abc import Sequence

import moderngl
import numpy as np

from enliven.arrays import Float32
from enliven_viewer.playback.timeline import CueFrame
from enliven_viewer.render.gl.program import load_program, set_uniform
from enliven_viewer.render.materials.paint import linear_from_srgb
from enliven_viewer.render.scene import Scene, SceneCharacter
from enliven_viewer.theme import PERFORMER_COLOURS

CUE_TINT = (1.0, 0.74, 0.22)
"""Linear RGB of attachment points if one performer controls a mesh: amber."""
NODE_TINT = (0.30, 0.62, 1.0)
"""Linear RGB of a graph's nodes: cold, in contrast to attachment points."""
EDGE_TINT = (0.30, 0.62, 1.0, 0.34)
"""Linear RGB and opacity of a graph's edges: fainter than its nodes."""
CUE_RADIUS = 0.030
"""Radius in metres of an attachment point at full strength: about half the width of a wrist."""
NODE_RADIUS = 0.012
"""Radius of a node in metres. It is small, since a graph has hundreds of nodes."""
POINT_RADIUS = 0.020
"""Radius in metres of a puppet's control point. It is larger than a node's, because a puppet has only a few
control points.
"""
_SQUARE = np.array([[-1, -1], [1, -1], [-1, 1], [1, 1]], np.float32)


def make_cue_rows(actor: SceneCharacter, strength: float, bodies: Sequence[int] = ()) -> Float32:
    """Returns (A, 8) float32 rows of an actor's attachment points: xyz and radius, rgb and strength.

    Args:
        bodies: ids of the visible performers, in the order of their colours.
    """
    cues = actor.cues
    if cues is None or strength <= 0:
        return np.zeros((0, 8), np.float32)
    is_valid = cues.nodes < len(actor.pose.positions)
    levels = np.clip(cues.strengths[is_valid], 0, 1)
    rows = np.empty((int(is_valid.sum()), 8), np.float32)
    rows[:, :3] = actor.pose.positions[cues.nodes[is_valid]]
    rows[:, 3] = CUE_RADIUS * (0.65 + 0.35 * levels)
    has_several = len(set(cues.owners.tolist())) > 1
    rows[:, 4:7] = find_cue_tints(cues, bodies)[is_valid] if has_several else CUE_TINT
    rows[:, 7] = strength * (0.35 + 0.65 * levels) * np.where(cues.attached_mask[is_valid], 1.0, 0.45)
    return rows


def find_cue_tints(cues: CueFrame, bodies: Sequence[int] = ()) -> Float32:
    """Returns (A, 3) linear RGB of attachment points: the colours of their performers' skeletons. ``bodies``
    is as in :func:`make_cue_rows`.
    """
    owners = cues.owners.tolist() if len(cues.owners) == len(cues.nodes) else [0] * len(cues.nodes)
    everybody = dict.fromkeys([*bodies, *sorted(owners)]) if len(cues.owners) else {0: None}
    tints = linear_from_srgb(np.array(PERFORMER_COLOURS, float))
    number = {body: k % len(tints) for k, body in enumerate(everybody)}
    return np.asarray(tints[[number[owner] for owner in owners]], np.float32)


def make_node_rows(actor: SceneCharacter, strength: float) -> Float32:
    """Returns (N, 8) float32 rows of an actor's graph nodes, in the format of :func:`make_cue_rows`. For a
    puppet, the rows are its control points.
    """
    points = actor.character.kind == "points"
    places = actor.pose.positions[1:] if points else actor.pose.positions
    rows = np.empty((len(places), 8), np.float32)
    rows[:, :3] = places
    rows[:, 3:] = (POINT_RADIUS if points else NODE_RADIUS, *NODE_TINT, strength)
    return rows


class Marks:
    """The render pass of a scene's marks, over its image."""

    def __init__(self, ctx: moderngl.Context) -> None:
        self.ctx = ctx
        self._dot = load_program(ctx, "dot.vert", "dot.frag")
        self._line = load_program(ctx, "line.vert", "line.frag")
        self._rows = ctx.buffer(reserve=8 * 4 * 64, dynamic=True)
        self._points = ctx.buffer(reserve=12 * 64, dynamic=True)
        square = ctx.buffer(_SQUARE.tobytes())
        self._dots = ctx.vertex_array(
            self._dot, [(square, "2f", "in_corner"), (self._rows, "4f 4f/i", "in_centre", "in_tint")]
        )
        self._lines = ctx.vertex_array(self._line, [(self._points, "3f", "in_position")])

    def draw(self, scene: Scene) -> None:
        """Draws graphs with the style's strength, then attachment points. Occluded marks are fainter."""
        self.ctx.enable_only(moderngl.DEPTH_TEST | moderngl.BLEND)
        self.ctx.blend_equation = moderngl.FUNC_ADD  # type: ignore[assignment]
        if scene.style.graph > 0:
            for actor in scene.actors:
                self._draw_graph(actor, scene.style.graph)
        bodies = [body.id for body in scene.bodies]
        rows = [make_cue_rows(actor, scene.style.cues, bodies) for actor in scene.actors]
        self._draw_dots(np.concatenate(rows) if rows else np.zeros((0, 8), np.float32), 3.0, 1.1)

    def _draw_graph(self, actor: SceneCharacter, strength: float) -> None:
        ends = actor.pose.positions[actor.character.edges.reshape(-1)].astype(np.float32)
        # A puppet has no edges between its control points.
        if len(ends) and actor.character.kind != "points":
            self._points.orphan(ends.nbytes)
            self._points.write(np.ascontiguousarray(ends))
            self.ctx.blend_func = moderngl.SRC_ALPHA, moderngl.ONE_MINUS_SRC_ALPHA
            for test, fraction in (("<=", 1.0), (">", 0.3)):
                self.ctx.depth_func = test
                self._line["tint"] = (*EDGE_TINT[:3], EDGE_TINT[3] * strength * fraction)
                self._lines.render(moderngl.LINES, vertices=len(ends))
        self._draw_dots(make_node_rows(actor, strength), 2.0, 0.0)

    def _draw_dots(self, rows: Float32, least_pixels: float, halo: float) -> None:
        if not len(rows):
            return
        self._rows.orphan(rows.nbytes)
        self._rows.write(np.ascontiguousarray(rows))
        self.ctx.blend_func = moderngl.ONE, moderngl.ONE
        set_uniform(self._dot, "least_pixels", least_pixels)
        set_uniform(self._dot, "halo", halo)
        for test, fade in (("<=", 1.0), (">", 0.30)):
            self.ctx.depth_func = test
            set_uniform(self._dot, "fade", fade)
            self._dots.render(moderngl.TRIANGLE_STRIP, vertices=4, instances=len(rows))
