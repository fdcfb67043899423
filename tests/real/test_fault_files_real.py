"""Tests that small files that once failed are read by every entry point: meshes, motion captures, depth
images.
"""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import typer
from typer.testing import CliRunner

from enliven.cli import run
from enliven.errors import InputError
from enliven.formats.gltf.read import read_gltf
from enliven.formats.project.file import read_project
from enliven.meshes import load_mesh, load_upright
from enliven.modeling.mesh.solids import Solid, solid_from_mesh
from enliven.motion_clips.take_files import read_take
from enliven.recording import Recording
from enliven.rotation import rotate
from enliven_edge.commands.import_ import import_recording
from enliven_edge.commands.track import track
from enliven_viewer.studio.editor.editor import Editor
from enliven_viewer.studio.puppets.puppet_editor import get_puppet_editor
from enliven_viewer.studio.workspace.files import add_file

DATA = Path(os.environ.get("ENLIVEN_DATA", Path(__file__).parents[3] / "shared" / "data"))
FAULTS = DATA / "faults"
pytestmark = [
    pytest.mark.real,
    pytest.mark.skipif(not FAULTS.is_dir(), reason="the files that failed once (ENLIVEN_DATA) are not here"),
]
app = typer.Typer(pretty_exceptions_enable=False)
app.command("import")(import_recording)
app.command("track")(track)


def call(*words) -> str:
    """Runs import or track and returns its output, or raises its error."""
    result = CliRunner().invoke(app, [str(word) for word in words])
    if isinstance(result.exception, InputError):
        raise result.exception
    assert result.exit_code == 0, result.output
    return result.output


MESHES = {
    "concave_L.obj": (5.9, 12, ""),
    "half_flipped.obj": (
        2.2277,
        206,
        "204 of 408 faces had another winding than their neighbours and were flipped",
    ),
    "inside_out.obj": (2.2277, 206, "the faces of the mesh pointed inwards"),
    "latin1_comment.obj": (2.2277, 206, ""),
    "tokens.off": (2.366, 4, ""),
    "bin_tail.stl": (2.2277, 206, "bytes after the last triangle"),
}
"""Area in square units, vertices, and words of a note, for each mesh."""


@pytest.mark.parametrize("name", list(MESHES))
def test_a_mesh_has_its_area_and_faces_outwards(name: str) -> None:
    area, count, words = MESHES[name]
    for read in (load_mesh, load_upright):
        mesh, notes = read(FAULTS / name)
        assert mesh.area == pytest.approx(area, rel=1e-3)
        assert len(mesh.vertices) == count
        assert words in " ".join(notes)
        assert np.einsum("fa,fa->", mesh.vertices[mesh.faces[:, 0]], mesh.face_vectors()) > 0


@pytest.mark.parametrize("name", list(MESHES))
def test_the_studio_adds_a_mesh(name: str) -> None:
    editor = Editor()
    get_puppet_editor(editor)  # This call registers the editor of puppets, as the workspace does.
    add_file(editor, FAULTS / name)
    (puppet,) = editor.project.puppets.values()
    area = MESHES[name][0]
    height = np.ptp(load_mesh(FAULTS / name).mesh.vertices[:, 1])
    scale = np.ptp(puppet.mesh.vertices[:, 1]) / height
    assert puppet.mesh.area == pytest.approx(area * scale**2, rel=0.01)


def test_index_zero_is_refused_with_its_line() -> None:
    lines = (FAULTS / "zeroidx.obj").read_text().splitlines()
    number = next(
        n
        for n, line in enumerate(lines, 1)
        if line.startswith("f ") and " 0" in f" {line} ".replace(" 0 ", " 0")
    )
    for read in (load_mesh, load_upright, lambda path: add_file(Editor(), path)):
        with pytest.raises(InputError, match=rf"line {number}: a face refers to vertex 0"):
            read(FAULTS / "zeroidx.obj")


def test_flipped_meshes_are_possessed_as_the_clean_one(tmp_path) -> None:
    call("import", FAULTS / "brace_same_line.bvh", "-o", tmp_path / "bodies.mcap")
    possessed = []
    for name in ("latin1_comment.obj", "half_flipped.obj", "inside_out.obj"):
        path = tmp_path / f"{name}.enliven"
        assert (
            run(["possess", str(tmp_path / "bodies.mcap"), "--mesh", str(FAULTS / name), "-o", str(path)])
            == 0
        )
        project = read_project(path)
        (graph,) = project.graphs.values()
        possessed.append((graph.mesh, project.streams))
    for mesh, streams in possessed[1:]:
        np.testing.assert_allclose(mesh.vertices, possessed[0][0].vertices, atol=1e-9)
        np.testing.assert_allclose(
            mesh.face_normals().sum(0), possessed[0][0].face_normals().sum(0), atol=1e-9
        )
        for stream, other in zip(streams.values(), possessed[0][1].values(), strict=True):
            np.testing.assert_allclose(stream.positions, other.positions, atol=1e-3)


@pytest.mark.parametrize("name", ["latin1_comment.obj", "half_flipped.obj", "inside_out.obj"])
def test_flipped_meshes_merge_to_one_shell(name: str) -> None:
    mesh, other = load_mesh(FAULTS / name).mesh, load_mesh(FAULTS / "latin1_comment.obj").mesh
    first, second = (
        solid_from_mesh(mesh),
        solid_from_mesh(replace(other, vertices=other.vertices + np.array([0.05, 0.02, 0.0]))),
    )
    assert isinstance(first, Solid) and isinstance(second, Solid), "neither has a face that is wound wrongly"
    assert len((first.manifold + second.manifold).decompose()) == 1
    assert first.manifold.volume() == pytest.approx(second.manifold.volume())


def heights(clip) -> np.ndarray:
    """Returns (F,) distances from the lowest to the highest joint of a clip, metres."""
    rest, parents = clip.skeleton.positions, clip.skeleton.parents
    at = [clip.root]
    for j in range(1, len(parents)):
        at.append(at[parents[j]] + rotate(clip.turns[:, j], rest[j] - rest[parents[j]]))
    return np.ptp(np.stack(at)[..., 1], axis=0)


@pytest.mark.parametrize("name", ["z_up.bvh", "brace_same_line.bvh"])
def test_a_capture_is_upright_by_every_road(name: str, tmp_path) -> None:
    path = FAULTS / name
    clip, notes = read_take(path)
    assert np.ptp(clip.skeleton.positions[:, 1]) == pytest.approx(1.7, abs=0.005)
    assert np.median(heights(clip)) == pytest.approx(1.68, abs=0.03)
    assert bool(notes) == (name == "z_up.bvh")

    call("import", path, "-o", tmp_path / "bodies.mcap")
    (bodies,) = (frame.bodies[0].joints for frame in list(Recording(tmp_path / "bodies.mcap").frames())[:1])
    assert 1.4 < np.ptp(bodies[:, 1]) < 1.75

    assert run(["export", str(path), "-o", str(tmp_path / "out.bvh")]) == 0
    np.testing.assert_allclose(heights(read_take(tmp_path / "out.bvh")[0]), heights(clip), atol=0.01)

    model = DATA / "gltf" / "khronos" / "RiggedFigure.glb"
    assert run(["retarget", str(path), str(model), "-o", str(tmp_path / "out.glb"), "--end", "0.2"]) == 0
    (moved,) = read_gltf(tmp_path / "out.glb").clips
    still = read_gltf(model).shape.skeleton.positions
    assert np.median(heights(moved)) > 0.9 * np.ptp(still[:, 1]), "the model stands"

    editor = Editor()
    add_file(editor, path)
    (take,) = editor.project.takes.values()
    np.testing.assert_array_equal(take.turns, clip.turns)


def test_the_two_captures_are_the_same_motion() -> None:
    first, second = (read_take(FAULTS / name)[0] for name in ("z_up.bvh", "brace_same_line.bvh"))
    assert first.skeleton.names == second.skeleton.names
    np.testing.assert_allclose(first.skeleton.positions, second.skeleton.positions, atol=1e-3)
    np.testing.assert_allclose(first.root, second.root, atol=1e-3)


def test_a_wall_of_the_tum_benchmark_is_at_two_metres(tmp_path) -> None:
    output = call("import", FAULTS / "tum", "-o", tmp_path / "a.mcap")
    assert "5000 units per metre" in output and "tum-depth" in output
    frames = list(Recording(tmp_path / "a.mcap").frames())
    assert [np.median(frame.depth) for frame in frames] == [2000, 2000]
    assert frames[1].time_ns - frames[0].time_ns == 33_333_000
    call("import", FAULTS / "tum", "-o", tmp_path / "b.mcap", "--units-per-metre", 1000)
    assert np.median(next(iter(Recording(tmp_path / "b.mcap").frames())).depth) == 10_000
    assert "5000 units per metre" in call("track", FAULTS / "tum", "-o", tmp_path / "c.mcap")


def test_an_empty_image_is_named_and_later_times_stay(tmp_path) -> None:
    output = call("import", FAULTS / "depth_empty_png", "-o", tmp_path / "a.mcap", "--fps", 10)
    assert "depth_3.png is skipped: the file is empty" in output
    assert [frame.time_ns for frame in Recording(tmp_path / "a.mcap").frames()] == [0, 10**8, 3 * 10**8]
    assert "depth_3.png" in call("track", FAULTS / "depth_empty_png", "-o", tmp_path / "b.mcap")
