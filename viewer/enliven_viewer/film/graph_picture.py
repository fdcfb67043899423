"""An image of a deformation graph over its mesh from three sides: nodes, edges, bridges, cut vertices."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from enliven.arrays import Float, Float32, UInt8
from enliven.deformation.graph.graph import DeformationGraph
from enliven.document import Character
from enliven.files import write_picture
from enliven_viewer.film.sheet import BACKGROUND_COLOUR, SUBTITLE_COLOUR, TITLE_COLOUR
from enliven_viewer.render.camera import Box, CameraView, OrbitCamera
from enliven_viewer.render.gl.context import create_offscreen_context
from enliven_viewer.render.materials.paint import linear_from_srgb
from enliven_viewer.render.overlay.tubes import Tubes, make_tube_rows
from enliven_viewer.render.renderer import Renderer
from enliven_viewer.render.scene import Scene, SceneCharacter, SceneStyle

MESH_COLOUR = (112, 116, 126)
"""sRGB of the mesh: grey, so that the colours of the graph are clearly visible."""
NODE_COLOUR = (236, 244, 255)
"""sRGB of nodes: nearly white, so that they are brighter than the grey mesh."""
EDGE_COLOUR = (92, 178, 255)
"""sRGB of edges without an E_rig term: a cold colour, because they need no attention."""
BRIDGE_COLOUR = (255, 74, 52)
"""sRGB of bridges. Removing a bridge splits the graph, so a limb depends on this single edge. Red warns of
that.
"""
RIGID_EDGE_COLOUR = (255, 190, 64)
"""sRGB of edges with an E_rig term that are not bridges: amber, a weaker warning colour than red."""
CUT_VERTEX_COLOUR = (255, 96, 214)
"""sRGB of cut vertices. Removing one splits the graph too. The colour differs from the red of bridges."""
VIEW_AZIMUTHS = (math.radians(-24), math.radians(96), math.radians(216))
"""Azimuth of each view's camera in radians, measured from the front right. The views are 120 degrees apart.
"""
HEADER_HEIGHT_PX = 88
"""Height in pixels of the title above the panels: one line of 30 pixels with margins."""
_FOOTER_HEIGHT_PX = 72
"""Height in pixels of the legend below the panels: one line of 20 pixels with margins."""
_MAX_EXTENT_M = 1.75
"""Largest extent of the drawing in metres, regardless of the mesh's own size."""


class GraphCounts(NamedTuple):
    """The numbers in the legend of a graph's image. ``radius`` is the distance R between nodes in metres."""

    nodes: int
    edges: int
    bridges: int
    rigid: int
    cut_vertices: int
    radius: float


def count_graph_parts(graph: DeformationGraph) -> GraphCounts:
    """Returns the numbers of nodes, edges, bridges and cut vertices of a graph."""
    return GraphCounts(
        len(graph.positions),
        len(graph.edges),
        int(graph.bridges.sum()),
        int(graph.rigid.sum()),
        int(graph.cut_vertices.sum()),
        graph.radius,
    )


def draw_graph(character: Character, graph: DeformationGraph, panel: tuple[int, int]) -> list[UInt8]:
    """Returns three views of the mesh with its graph.

    Each is (H, W, 3) sRGB of the size ``panel`` (width, height).
    """
    scaled_character, nodes, scale = fit_graph(character, graph)
    renderer = Renderer(create_offscreen_context(), panel)
    tubes = Tubes(renderer.ctx)
    spacing = scale * math.sqrt(_measure_area(character) / len(nodes))
    scene = Scene(
        (SceneCharacter(scaled_character, scaled_character.rest_pose()),),
        (),
        SceneStyle(body=0, reveal=0, cues=0),
    )
    box = (scaled_character.vertices.min(0).astype(float), scaled_character.vertices.max(0).astype(float))
    return [
        _draw_view(renderer, tubes, scene, box, graph, nodes, spacing, azimuth) for azimuth in VIEW_AZIMUTHS
    ]


def _draw_view(
    renderer: Renderer,
    tubes: Tubes,
    scene: Scene,
    box: Box,
    graph: DeformationGraph,
    nodes: Float,
    spacing: float,
    turn: float,
) -> UInt8:
    """Returns one image. The camera is rotated by ``turn`` radians from the front right."""
    width, height = renderer.size
    view = make_view(box, width / height, turn)
    renderer.draw(scene, view)
    distance = float(np.linalg.norm(view.eye - (box[0] + box[1]) / 2))
    pixel = distance / (view.clip_from_camera[1, 1] * height / 2)
    tubes.draw(renderer.picture, make_graph_rows(graph, nodes, spacing, pixel), 0.3 * spacing)
    return renderer.pixels()


def make_view(box: Box, aspect: float, turn: float) -> CameraView:
    """Returns a camera that frames the box, rotated by ``turn`` radians from the front right."""
    camera = OrbitCamera(math.radians(24))
    camera.orbit(turn, math.radians(3))
    camera.frame(box, aspect, at_once=True, margin=1.08)
    return camera.view(aspect)


def make_graph_rows(graph: DeformationGraph, nodes: Float, spacing: float, pixel: float) -> Float32:
    """Returns (E + N, 12) instance rows for :class:`Tubes`: a tube for each edge, then a ball for each node.
    Tubes and balls are never thinner than about a pixel.

    Args:
        nodes: (N, 3) metres, the drawn positions of the nodes.
        spacing: metres between nodes.
        pixel: size of a pixel in metres at the mesh.
    """
    thin = max(0.026 * spacing, 0.8 * pixel)
    edge_tints = np.tile(linear_from_srgb(np.array(EDGE_COLOUR)), (len(graph.edges), 1))
    edge_tints[graph.rigid] = linear_from_srgb(np.array(RIGID_EDGE_COLOUR))
    edge_tints[graph.bridges] = linear_from_srgb(np.array(BRIDGE_COLOUR))
    edge_radii = np.where(graph.rigid, 1.9, 1.0) * thin
    node_tints = np.tile(linear_from_srgb(np.array(NODE_COLOUR)), (len(nodes), 1))
    node_tints[graph.cut_vertices] = linear_from_srgb(np.array(CUT_VERTEX_COLOUR))
    node_radii = np.where(graph.cut_vertices, 3.4, 2.3) * thin
    starts, ends = nodes[graph.edges[:, 0]], nodes[graph.edges[:, 1]]
    return np.concatenate(
        [
            make_tube_rows(starts, ends, edge_radii, edge_tints),
            make_tube_rows(nodes, nodes, node_radii, node_tints),
        ]
    )


def fit_graph(character: Character, graph: DeformationGraph) -> tuple[Character, Float, float]:
    """Returns the character and its (N, 3) nodes, both scaled for drawing and placed on the floor, and the
    scale factor.
    """
    low, high = character.vertices.min(0), character.vertices.max(0)
    scale = _MAX_EXTENT_M / max(float((high - low).max()), 1e-12)
    foot = np.array([(low[0] + high[0]) / 2, low[1], (low[2] + high[2]) / 2], np.float64)
    colours = np.tile(np.array(MESH_COLOUR, np.uint8), (len(character.vertices), 1))
    nodes = (graph.positions - foot) * scale
    vertices = ((character.vertices - foot) * scale).astype(np.float32)
    return (
        replace(character, vertices=vertices, pivots=nodes.astype(np.float32), colours=colours),
        nodes,
        scale,
    )


def _measure_area(character: Character) -> float:
    a, b, c = (character.vertices[character.faces[:, k]].astype(np.float64) for k in range(3))
    return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)


def write_graph_picture(
    path: Path, character: Character, graph: DeformationGraph, title: str, panel: tuple[int, int]
) -> GraphCounts:
    """Draws the graph and writes the image, in the format of the file extension.

    Raises:
        ResourceError: if OpenGL is missing, or the file cannot be written.
    """
    counts = count_graph_parts(graph)
    sheet = compose_views(draw_graph(character, graph, panel), title, counts)
    write_picture(path, sheet)
    return counts


def compose_views(panels: list[UInt8], title: str, counts: GraphCounts) -> Image.Image:
    """Returns the panels side by side below a title and above a legend."""
    height, width = panels[0].shape[:2]
    sheet = Image.new(
        "RGB", (width * len(panels), HEADER_HEIGHT_PX + height + _FOOTER_HEIGHT_PX), BACKGROUND_COLOUR
    )
    for number, panel in enumerate(panels):
        sheet.paste(Image.fromarray(panel), (number * width, HEADER_HEIGHT_PX))
    draw = ImageDraw.Draw(sheet)
    draw.text((28, 24), title, fill=TITLE_COLOUR, font=ImageFont.load_default(30))
    radius_text = f"R = {counts.radius:.3g} m"
    font = ImageFont.load_default(20)
    draw.text(
        (sheet.width - 28 - font.getlength(radius_text), 33), radius_text, fill=SUBTITLE_COLOUR, font=font
    )
    _draw_legend(draw, sheet.width, HEADER_HEIGHT_PX + height, counts)
    return sheet


def _draw_legend(draw: ImageDraw.ImageDraw, width: int, top: int, counts: GraphCounts) -> None:
    """Draws colour swatches with names and numbers, distributed over the width."""
    items = (
        (NODE_COLOUR, True, f"{counts.nodes} nodes"),
        (EDGE_COLOUR, False, f"{counts.edges} edges"),
        (BRIDGE_COLOUR, False, f"{counts.bridges} bridges"),
        (RIGID_EDGE_COLOUR, False, f"{counts.rigid - counts.bridges} at cut vertices"),
        (CUT_VERTEX_COLOUR, True, f"{counts.cut_vertices} cut vertices"),
    )
    font = ImageFont.load_default(max(min(20, width // 56), 10))
    step = (width - 56) / len(items)
    for number, (colour, ball, text) in enumerate(items):
        x, y = 28 + number * step, top + _FOOTER_HEIGHT_PX / 2
        if ball:
            draw.ellipse((x + 6, y - 8, x + 22, y + 8), fill=colour)
        else:
            draw.rounded_rectangle((x, y - 3, x + 28, y + 3), 3, fill=colour)
        draw.text((x + 40, y), text, fill=TITLE_COLOUR, font=font, anchor="lm")
