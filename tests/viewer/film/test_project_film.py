"""Tests of films of a project: one fixed camera shows all of it, in both formats."""

import math

import numpy as np
import pytest
from PIL import Image

from enliven import Mesh, Project
from enliven.errors import InputError
from enliven.modeling.edits import move_character
from enliven.modeling.puppet.edits import make_puppet
from enliven_viewer.film.project_film import FRAMED_FRACTION, frame_points, write_project_film
from enliven_viewer.render.camera import OrbitCamera

pytestmark = pytest.mark.usefixtures("gl")
SIZE = (96, 60)


@pytest.fixture
def block() -> Project:
    corners = np.array([[x, y, z] for x in (-0.3, 0.3) for y in (0.0, 1.0) for z in (-0.2, 0.2)])
    faces = [[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1]]
    faces += [[2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]]
    return make_puppet(Project(), Mesh(corners, np.array(faces, np.int32), "block"), "block")


@pytest.mark.parametrize("seed", range(5))
def test_the_camera_shows_all_points_and_no_more_room_than_necessary(seed):
    random = np.random.default_rng(seed)
    points = random.normal(size=(200, 3)) * random.uniform(0.2, 2.0, 3) + [0.0, 4.0, 0.0]
    camera = OrbitCamera(math.radians(28))
    frame_points(camera, points, random.uniform(-1.0, 1.0), 0.2, 1.6)
    reach = np.abs(camera.view(1.6).project(points)).max(0)
    assert reach.max() == pytest.approx(FRAMED_FRACTION, abs=1e-6)


def test_a_film_has_an_image_for_each_version_of_a_project(block, tmp_path):
    path = tmp_path / "moved.webp"
    versions = [move_character(block, "block", [0.3 * number, 0.0, 0.0]) for number in range(3)]
    write_project_film(path, versions, [0.0] * 3, size=SIZE, rate=10)
    with Image.open(path) as film:
        assert (film.n_frames, film.size, film.info["loop"]) == (3, SIZE, 0)
        film.load()
        assert film.info["duration"] == 100


def test_an_mp4_film_is_written(block, tmp_path):
    pytest.importorskip("av", reason="PyAV is not installed (the extra 'film')")
    path = tmp_path / "still.mp4"
    write_project_film(path, block, [0.0, 0.1], size=SIZE)
    assert path.stat().st_size > 500


def test_wrong_numbers_of_values_and_other_suffixes_are_refused(block, tmp_path):
    with pytest.raises(ValueError, match="3 projects for 2 times"):
        write_project_film(tmp_path / "a.webp", [block] * 3, [0.0, 0.1])
    with pytest.raises(InputError, match=r"\.gif cannot be written"):
        write_project_film(tmp_path / "a.gif", block, [0.0])
    with pytest.raises(InputError, match="nothing to film"):
        write_project_film(tmp_path / "a.webp", Project(), [0.0])
