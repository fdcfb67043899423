"""Tests that the shipped samples equal the output of scripts/make_samples.py, and are small."""

from __future__ import annotations

import zipfile

import make_samples
import numpy as np
import pytest
from scipy.spatial import cKDTree

from enliven.formats.project.file import read_project
from enliven.meshes.mesh import Mesh
from enliven.samples import shipped
from enliven.samples.shipped import COORDINATE_STEP_M, cactus_project, load_sample
from enliven_viewer.studio.workspace.files import read_library

FILES = ("chair.npz", "lamp.npz", "cactus.enliven")


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    folder = tmp_path_factory.mktemp("samples")
    make_samples.write_samples(folder)
    return folder


def assert_the_same_surface(shown: Mesh, made: Mesh) -> None:
    """Checks that each vertex has one of the other mesh within two quantisation steps. Processors round sines
    differently.
    """
    assert abs(len(shown.vertices) - len(made.vertices)) <= 8
    assert abs(len(shown.faces) - len(made.faces)) <= 16
    for first, second in ((shown, made), (made, shown)):
        away, at = cKDTree(second.vertices).query(first.vertices)
        assert np.quantile(away, 0.999) <= 2 * COORDINATE_STEP_M and away.max() < 0.01
        assert np.quantile(np.abs(first.colours.astype(int) - second.colours[at]), 0.999) <= 1


@pytest.mark.slow
@pytest.mark.parametrize("name", ["chair", "lamp"])
def test_the_script_makes_the_meshes_that_ship(made, monkeypatch, name):
    shown = load_sample(name)
    monkeypatch.setattr(shipped, "SAMPLES_FOLDER", made)
    assert_the_same_surface(shown, load_sample(name))


def test_the_script_makes_the_puppet_that_ships(made):
    shown, again = cactus_project(), read_project(made / "cactus.enliven")
    puppet, other = shown.puppet("cactus"), again.puppet("cactus")
    assert_the_same_surface(puppet.mesh, other.mesh)
    assert [p.name for p in puppet.points] == [p.name for p in other.points]
    for pose, same in zip(puppet.poses, other.poses, strict=True):
        np.testing.assert_allclose(pose.places, same.places, atol=0.01)
    assert list(shown.takes) == list(again.takes) == ["cactus poses"]


def test_a_shipped_mesh_is_within_a_step_of_the_made_one():
    from sample_meshes.lamp import make_lamp

    np.testing.assert_allclose(load_sample("lamp").vertices, make_lamp().vertices, atol=COORDINATE_STEP_M)


def test_the_script_makes_the_motions_that_ship(tmp_path):
    make_samples.write_motions(tmp_path / "motions.enliven")
    again = read_project(tmp_path / "motions.enliven").takes
    assert [clip.id for clip in read_library()] == list(again)
    for clip in read_library():
        np.testing.assert_allclose(clip.turns, again[clip.id].turns, atol=1e-12)
        np.testing.assert_allclose(clip.root, again[clip.id].root, atol=1e-12)
        looped = clip.id != "quarter turn"
        assert np.allclose(clip.turns[0], clip.turns[-1], atol=1e-9) == looped


def test_the_files_are_small_and_whole():
    assert sum((shipped.SAMPLES_FOLDER / name).stat().st_size for name in FILES) < 300_000
    for name in FILES:
        assert zipfile.ZipFile(shipped.SAMPLES_FOLDER / name).testzip() is None
