"""Tests of folders with one OBJ file for each frame: exact points, materials, and no partial output."""

import sys
from dataclasses import replace

import made_puppets
import numpy as np
import pytest
from made_bodies import man, random_motion, shape_with_markers
from test_materials import BUMPS, WOOD, made_file

from enliven.cli import run
from enliven.document import Project
from enliven.errors import InputError, ResourceError
from enliven.examples.baking.frames import SurfaceFrames, evaluate_states
from enliven.exporters import exporter_of, sample_performance
from enliven.formats.gltf.read import read_gltf
from enliven.formats.rig.rig import play_clip
from enliven.meshes import load_mesh
from enliven.meshes.obj import read_obj


@pytest.fixture(scope="module")
def walk():
    shape = shape_with_markers("man", man())
    return play_clip(Project(), shape, random_motion(np.random.default_rng(1), shape.skeleton, name="walk"))[
        0
    ]


def vertices_of(path):
    lines = [line.split() for line in path.read_text().splitlines() if line.startswith("v ")]
    return np.array([[float(word) for word in words[1:4]] for words in lines])


def test_each_frame_has_the_surface_and_the_same_faces(walk, tmp_path):
    folder, performance = tmp_path / "walk.obj-sequence", sample_performance(walk, "man", rate=20.0)
    shares = []
    exporter_of(folder).save(folder, [performance], "walk", progress=shares.append)
    files = sorted(folder.iterdir())
    assert [path.name for path in files] == [f"walk_{k + 1:04d}.obj" for k in range(len(performance.times))]
    for path, surface in zip(files, performance.surfaces(), strict=True):
        np.testing.assert_allclose(vertices_of(path), surface, atol=1e-6)
    mesh, _ = read_obj(files[-1].read_bytes(), None, "walk")
    np.testing.assert_array_equal(mesh.faces, performance.mesh.faces)
    assert shares == sorted(shares) and shares[-1] == 1.0


def test_puppets_are_written_without_baking_error(tmp_path):
    project = made_puppets.project()
    folder = tmp_path / "bean.obj-sequence"
    exporter = exporter_of(folder)
    performance = sample_performance(project, "bean", 0.0, 0.3, 10.0, how=exporter.representation())
    assert performance.error is None
    exporter.save(folder, [performance], "bean")
    puppet = project.puppets["bean"]
    states, _, _ = evaluate_states(project, puppet, performance.times)
    solved = list(SurfaceFrames(puppet, states)())[3]
    written = vertices_of(folder / "bean_0004.obj")
    own = solved - solved.mean(0)
    assert np.linalg.norm(written - written.mean(0), axis=1) == pytest.approx(
        np.linalg.norm(own, axis=1), abs=1e-5
    )


def test_materials_images_and_colours_are_kept(tmp_path):
    made_file(tmp_path / "square.glb")
    shape = read_gltf(tmp_path / "square.glb").shape
    folder = tmp_path / "a square.obj-sequence"
    performance = sample_performance(Project().with_characters(shape), shape.id)
    exporter_of(folder).save(folder, [performance], "square")
    text = (folder / "a_square.mtl").read_text()
    (used,) = (line.split()[1] for line in text.splitlines() if line.startswith("map_Kd"))
    assert "Kd 0.900000 0.800000 0.700000" in text
    images = {path.read_bytes() for path in folder.glob("a_square_texture_*")}
    assert images == {WOOD, BUMPS} and (folder / used).exists()
    first = (folder / "a_square_0001.obj").read_text()
    assert "mtllib a_square.mtl\n" in first and first.count("usemtl ") == 3 and "vt " in first
    mesh, notes = load_mesh(folder / "a_square_0001.obj")
    assert len(mesh.faces) == 3 and not any("MTL" in note or "missing" in note for note in notes)


def test_texture_coordinates_of_the_second_character_follow_those_of_the_first(tmp_path):
    made_file(tmp_path / "square.glb")
    shape = read_gltf(tmp_path / "square.glb").shape
    performance = sample_performance(Project().with_characters(shape), shape.id)
    folder = tmp_path / "two.obj-sequence"
    exporter_of(folder).save(folder, [performance, replace(performance, name="other one")], "two")
    text = (folder / "two_0001.obj").read_text()
    coordinates, vertices = text.count("vt "), text.count("v ")
    words = [word for line in text.splitlines() if line.startswith("f ") for word in line.split()[1:]]
    numbers = np.array([[int(part) for part in word.split("/")] for word in words])
    assert numbers.max(0).tolist() == [vertices, coordinates] and "o other_one\n" in text
    half = len(numbers) // 2
    np.testing.assert_array_equal(numbers[half:], numbers[:half] + np.array([vertices, coordinates]) // 2)


def test_the_shorter_of_two_motions_holds_its_last_pose(walk, tmp_path):
    folder = tmp_path / "two.obj-sequence"
    long, short = sample_performance(walk, "man", rate=20.0), sample_performance(walk, "man", 0.0, 0.1, 20.0)
    exporter_of(folder).save(folder, [long, replace(short, name="short")], "two")
    files = sorted(folder.iterdir())
    assert len(files) == len(long.times)
    count = len(long.mesh.vertices)
    np.testing.assert_allclose(vertices_of(files[-1])[count:], list(short.surfaces())[-1], atol=1e-6)


def interrupt(share):
    if share > 0.3:
        raise KeyboardInterrupt


@pytest.mark.parametrize("existed", [True, False])
def test_interrupted_sequence_leaves_only_the_older_folder(walk, tmp_path, existed):
    folder, performance = tmp_path / "walk.obj-sequence", sample_performance(walk, "man")
    exporter = exporter_of(folder)
    if existed:
        exporter.save(folder, [replace(performance, times=performance.times[:1])], "older")
    before = sorted(tmp_path.rglob("*"))
    with pytest.raises(KeyboardInterrupt):
        exporter.save(folder, [performance], "walk", progress=interrupt)
    assert sorted(tmp_path.rglob("*")) == before
    exporter.save(folder, [performance], "walk")
    assert len(list(folder.iterdir())) == len(performance.times) and list(tmp_path.iterdir()) == [folder]


def test_full_disk_is_reported_and_leaves_nothing(walk, tmp_path, monkeypatch):
    folder, performance = tmp_path / "walk.obj-sequence", sample_performance(walk, "man")
    written = []

    def fail_at_third(path, *arguments):
        written.append(path)
        if len(written) == 3:
            raise OSError(28, "No space left on device")

    monkeypatch.setattr("pathlib.Path.write_text", fail_at_third)
    with pytest.raises(ResourceError, match="No space left"):
        exporter_of(folder).save(folder, [performance], "walk")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("name", ["notes.txt", "sub/walk_0001.obj"])
def test_a_folder_with_other_files_is_not_replaced(walk, tmp_path, name):
    folder = tmp_path / "walk.obj-sequence"
    (folder / name).parent.mkdir(parents=True)
    (folder / name).write_text("mine")
    with pytest.raises(InputError, match=f"contains other files, such as '{name.split('/')[0]}'"):
        exporter_of(folder).save(folder, [sample_performance(walk, "man")], "walk")
    assert (folder / name).read_text() == "mine" and list(tmp_path.iterdir()) == [folder]


@pytest.mark.skipif(sys.platform == "win32", reason="Windows users cannot make links")
def test_a_file_or_link_of_that_name_is_not_replaced(walk, tmp_path):
    (tmp_path / "a.obj-sequence").write_text("mine")
    (tmp_path / "b.obj-sequence").symlink_to(tmp_path / "a.obj-sequence")
    for name in ("a", "b"):
        folder = tmp_path / f"{name}.obj-sequence"
        with pytest.raises(InputError, match="is not a folder"):
            exporter_of(folder).save(folder, [sample_performance(walk, "man")], "walk")
    assert (tmp_path / "a.obj-sequence").read_text() == "mine"


def test_the_command_writes_a_sequence(walk, tmp_path, capsys):
    shape_file = tmp_path / "man.glb"
    exporter_of(shape_file).save(shape_file, [sample_performance(walk, "man", rate=10.0)], "man")
    words = ["-o", str(tmp_path / "man.obj-sequence"), "--unit", "cm", "--end", "0.2", "--rate", "10"]
    assert run(["export", str(shape_file), *words]) == 0
    assert "contains 0.20 s of motion of man" in capsys.readouterr().out
    files = sorted((tmp_path / "man.obj-sequence").iterdir())
    assert len(files) == 4 and np.ptp(vertices_of(files[1]), axis=0).max() > 100
