"""Tests of ``enliven graph`` with a real graph: each colour of the image is at its position."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from sample_meshes.isosurface import surface_of

from enliven.cli import run
from enliven.deformation.graph.graph import DeformationGraph, character_from_graph
from enliven.meshes.files import save_mesh
from enliven.meshes.mesh import Mesh
from enliven_viewer.film.graph_picture import (
    BRIDGE_COLOUR,
    HEADER_HEIGHT_PX,
    VIEW_AZIMUTHS,
    fit_graph,
    make_graph_rows,
    make_view,
)
from enliven_viewer.render.materials.paint import linear_from_srgb

SIZE = 320


@pytest.fixture(scope="module")
def balls():
    """Returns two balls that do not touch, so that one bridge connects their graphs."""
    centres = np.array([[0.0, 0.3, 0.0], [0.0, 1.3, 0.0]])

    def field(points):
        return np.min(np.linalg.norm(points[:, None] - centres, axis=2) - 0.3, axis=1)

    return Mesh(*surface_of(field, np.array([-0.4, -0.1, -0.4]), np.array([0.4, 1.7, 0.4]), 0.04), "balls")


def close_to(pixels, colour, tolerance=60):
    return np.abs(pixels.astype(int) - np.array(colour)).max(-1) < tolerance


@pytest.mark.slow
@pytest.mark.usefixtures("gl")
def test_the_bridge_is_red_where_it_is(balls, tmp_path, capsys):
    save_mesh(balls, tmp_path / "balls.obj")
    picture = tmp_path / "graph of balls.png"
    arguments = ["graph", str(tmp_path / "balls.obj"), "-o", str(picture), "--nodes", "40", "--height", "0"]
    assert run([*arguments, "--size", str(SIZE)]) == 0
    assert "1 bridges, 2 cut vertices" in capsys.readouterr().out
    pixels = np.asarray(Image.open(picture).convert("RGB"))
    height = SIZE * 5 // 4
    assert pixels.shape[1] == 3 * SIZE
    graph = DeformationGraph.build(balls, 40)
    shown, nodes, _ = fit_graph(character_from_graph(balls, graph, "balls"), graph)
    box = (shown.vertices.min(0).astype(float), shown.vertices.max(0).astype(float))
    middle = nodes[graph.edges[graph.bridges][0]].mean(0)
    for number, turn in enumerate(VIEW_AZIMUTHS):
        x, y = make_view(box, SIZE / height, turn).project(middle[None])[0]
        column, row = round((number + 0.5 + x / 2) * SIZE), round(HEADER_HEIGHT_PX + (0.5 - y / 2) * height)
        around = pixels[row - 2 : row + 3, column - 2 : column + 3]
        assert close_to(around, BRIDGE_COLOUR).any(), f"view {number}"
        # Only the bridge has this colour in the panel.
        red = close_to(
            pixels[HEADER_HEIGHT_PX : HEADER_HEIGHT_PX + height, number * SIZE : (number + 1) * SIZE],
            BRIDGE_COLOUR,
        )
        assert red.any(1).sum() < height / 3


def test_rows_mark_weak_values(balls):
    graph = DeformationGraph.build(balls, 40)
    rows = make_graph_rows(graph, graph.positions, 0.2, 0.001)
    edges = rows[: len(graph.edges)]
    np.testing.assert_array_equal(
        (edges[:, 8:11] == linear_from_srgb(np.array(BRIDGE_COLOUR))).all(1), graph.bridges
    )
    balls_of_nodes = rows[len(graph.edges) :]
    assert balls_of_nodes[graph.cut_vertices, 3].min() > balls_of_nodes[~graph.cut_vertices, 3].max()
    # With any number of nodes, no line is thinner than a pixel.
    assert make_graph_rows(graph, graph.positions, 0.0001, 0.001)[:, 3].min() >= 0.0008


@pytest.mark.parametrize(
    ("arguments", "code", "told"),
    [
        (["missing.obj", "-o", "out.png"], 3, "the file does not exist"),
        (["points.ply", "-o", "out.png"], 3, "no faces"),
        (["chair", "-o", "out.xyz"], 3, "images with the extension .xyz cannot be written"),
        (["chair", "-o", "out.png", "--radius", "-1"], 3, "radius"),
        (["tri.obj", "-o", "out.png", "--height", "-2"], 3, "height"),
        (["chair", "-o", "out.png", "--up", "w"], 2, "up"),
        (["chair"], 2, "output"),
    ],
)
def test_invalid_graph_arguments_are_reported(arguments, code, told, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    Path("points.ply").write_text(
        "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
        "end_header\n0 0 0\n1 0 0\n0 1 0\n"
    )
    Path("tri.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    assert run(["graph", *arguments]) == code
    assert told in capsys.readouterr().err.lower()
    assert not Path("out.png").exists()


@pytest.mark.usefixtures("gl")
def test_a_place_that_cannot_be_written(tmp_path, capsys):
    (tmp_path / "file").write_text("")
    (tmp_path / "tri.obj").write_text("v 0 0 0\nv 0.01 0 0\nv 0 0.01 0\nf 1 2 3\n")
    arguments = [str(tmp_path / "tri.obj"), "-o", str(tmp_path / "file" / "out.png"), "--nodes", "5"]
    assert run(["graph", *arguments, "--size", "160", "--height", "0"]) == 4
    assert "does not exist" in capsys.readouterr().err
