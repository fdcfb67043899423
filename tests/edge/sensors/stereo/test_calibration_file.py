"""Tests of the calibration file: it is read back unchanged, and contradictory files are refused with an
error.
"""

import re
from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

pytest.importorskip("cv2", reason='OpenCV is not installed: pip install "./edge[libcamera]"')
from stereo_rig import calibration_of, create_lenses

from enliven.errors import InputError, ResourceError
from enliven_edge.sensors.stereo.calibration import load_calibration, save_calibration

GOOD = calibration_of(*create_lenses())


@settings(max_examples=20)
@given(st.floats(0.01, 2.0), st.floats(-3, 3), st.floats(0, 2))
def test_calibration_file_round_trips(tmp_path_factory, baseline, crooked, bent):
    path = tmp_path_factory.mktemp("file") / "stereo.toml"
    calibration = calibration_of(*create_lenses(baseline=baseline, crooked=crooked, bent=bent))
    save_calibration(path, calibration, ["A remark\nof two lines."])
    assert load_calibration(path) == calibration
    assert path.read_text().startswith("# A remark of two lines.\n")


@pytest.mark.parametrize(
    ("line", "instead", "what"),
    [
        (r"version = 1", "version = 2", "version 2"),
        (r"baseline = .*", "baseline = 0.25", "baseline is 0.25 m"),
        (r"baseline = .*", "baseline = nan", "baseline"),
        (r"translation = \[-", "translation = [", "swapped"),
        (r"translation = .*", "translation = [-0.02, -0.098, 0.0]", "side by side"),
        (r"right_from_left = \[\n  \[0\.\d+", "right_from_left = [\n  [1.1", "not a rotation"),
        (r"width = 640", "width = 300", "outside the image"),
        (r"width = 640", "width = 640000", "width"),
        (r"width = 640", "widht = 640", "width"),
        (r"fx = .*", "fx = -3.0", "left.fx"),
        (r"distortion = .*", "distortion = [1.0]", "distortion"),
        (r"\[right\]", "[rigth]", "right"),
        (r"epipolar = .*", "", "epipolar is missing"),
    ],
)
def test_contradictory_calibration_file_is_refused(tmp_path, line, instead, what):
    path = tmp_path / "stereo.toml"
    save_calibration(path, GOOD, [])
    text, changed = re.subn(line, instead, path.read_text(), count=1)
    assert changed
    path.write_text(text)
    with pytest.raises(InputError, match=re.escape(what)) as raised:
        load_calibration(path)
    assert str(path) in str(raised.value)


def test_missing_calibration_file_names_the_command(tmp_path):
    with pytest.raises(InputError, match="enliven calibrate-stereo"):
        load_calibration(tmp_path / "stereo.toml")


def test_a_place_that_is_no_folder_is_refused_and_a_new_folder_made(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(ResourceError, match="cannot be written"):
        save_calibration(tmp_path / "file" / "stereo.toml", GOOD, [])
    path = tmp_path / "new folder" / "stereo.toml"
    save_calibration(path, replace(GOOD, epipolar=0.5), [])
    save_calibration(path, GOOD, [])
    assert load_calibration(path) == GOOD and [each.name for each in path.parent.iterdir()] == ["stereo.toml"]
