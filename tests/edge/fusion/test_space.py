"""Tests of the file with the sensors' poses."""

import os

import numpy as np
import pytest
from walkers import stand

from enliven.errors import InputError, ResourceError
from enliven.space.space_file import Place, Space, convert_to_nested_tuples, load_space, save_space

SPACE = Space(
    {
        "oak-1844": Place(
            convert_to_nested_tuples(np.eye(4)), convert_to_nested_tuples(stand(0.1, 1 / 3, 33.0)), 0
        ),
        'kinect2-138.251 "left"': Place(
            convert_to_nested_tuples(stand(2.0, -1.0, 91.7, 1.3)), None, -123456789012345
        ),
    }
)


def test_space_survives_saving_and_loading(tmp_path):
    path = tmp_path / "space.toml"
    assert save_space(path, SPACE, ["by a person", "two\nlines"]) is None
    assert load_space(path) == SPACE
    assert path.read_text().startswith("# by a person\n# two lines\n")


def test_previous_file_is_kept(tmp_path):
    path = tmp_path / "space.toml"
    path.write_text("# mine")
    old = save_space(path, SPACE, [])
    assert old is not None and old.read_text() == "# mine"
    assert load_space(path) == SPACE


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write everywhere")
def test_unwritable_folder_is_reported(tmp_path):
    tmp_path.chmod(0o500)
    with pytest.raises(ResourceError, match="cannot be written"):
        save_space(tmp_path / "space.toml", SPACE, [])


def test_failed_write_keeps_the_old_file(tmp_path, monkeypatch):
    path = tmp_path / "space.toml"
    save_space(path, SPACE, [])
    before = path.read_bytes()

    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(ResourceError, match="No space left"):
        save_space(path, Space({"other": Place()}), [])
    assert path.read_bytes() == before


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "contains no sensors"),
        ("sensors = 3", "contains no sensors"),
        ('[sensors."a"]\nworld_from_sensr = 1', "Did you mean world_from_sensor"),
        ('[sensors."a"]\nworld_from_sensor = [[1,0,0,0],[0,1,0,0],[0,0,1,0]]', "world_from_sensor"),
        ('[sensors."a"]\nworld_from_sensor = [[2,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]', "not a rigid"),
        ('[sensors."a"]\nworld_from_sensor = [[-1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]', "not a rigid"),
        ("[sensors", "not valid TOML"),
    ],
)
def test_a_wrong_file_is_refused(tmp_path, text, message):
    path = tmp_path / "space.toml"
    path.write_text(text)
    with pytest.raises(InputError, match=message):
        load_space(path)


def test_missing_space_file_names_the_calibrate_command(tmp_path):
    with pytest.raises(InputError, match="enliven calibrate"):
        load_space(tmp_path / "space.toml")
