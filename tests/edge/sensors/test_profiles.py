"""Tests of sensor profiles: every shipped file is valid and plausible, and invalid ones are refused with a
reason.
"""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from enliven.errors import InputError
from enliven_edge.sensors import profile_names, profiles_folder
from enliven_edge.sensors.profile import TypicalCamera, typical_camera
from enliven_synthesis.sensor.profile import load_profile


def test_known_cameras_have_profiles() -> None:
    expected = {"kinect1", "kinect2", "tof", "oak-d", "oak-d-lite", "realsense-d415", "pi-stereo"}
    assert expected <= set(profile_names())


@pytest.mark.parametrize("name", profile_names())
def test_a_shipped_profile_is_plausible(name: str) -> None:
    profile = load_profile(name)
    camera, reach = profile.camera, profile.range
    typical = typical_camera(name)
    assert typical == TypicalCamera(profile.intrinsics(), reach.near, reach.far)
    view = 2 * math.degrees(math.atan(camera.width / 2 / camera.fx))
    assert 50 < view < 100
    assert abs(camera.fx / camera.fy - 1) < 0.02
    assert abs(camera.cx / camera.width - 0.5) < 0.05 and abs(camera.cy / camera.height - 0.5) < 0.05
    assert len(profile.source) > 60
    for z in (reach.near, 1.0, 2.0, min(reach.far, 4.0)):
        assert 0.0003 < profile.sigma(z) < 0.12
        assert profile.step(z) <= 0.065
        # Published deviations include the quantisation, so they cannot be smaller.
        assert profile.sigma(z) > 0.9 * profile.step(z) / math.sqrt(12)


def test_kinect1_has_the_published_figures() -> None:
    kinect = load_profile("kinect1")
    assert kinect.sigma(2.0) == pytest.approx(0.0012 + 0.0019 * 1.6**2)  # Nguyen et al. 2012, eq. 2
    assert kinect.step(2.6) == pytest.approx(2.6**2 / (580 * 0.075 * 8), rel=1e-9)


def test_intrinsics_scale_with_the_width() -> None:
    half = load_profile("kinect1").intrinsics(320)
    assert (half.width, half.height, half.fx, half.cx, half.cy) == (320, 240, 290.0, 159.5, 119.5)


def test_an_unknown_name_names_the_nearest() -> None:
    with pytest.raises(InputError, match="Did you mean 'kinect1'"):
        load_profile("kinekt1")


@pytest.mark.parametrize(
    ("before", "after", "message"),
    [
        ("near = 0.8", "near = 9.0", "must be smaller than range.far"),
        ("baseline = -0.075", "baseline = 0.0", "baseline"),
        ("cx = 319.5", "cx = 900.0", "principal point"),
        ("constant =", "constnat =", "Did you mean noise.constant"),
        ('kind = "structured light"', 'kind = "sonar"', "kind"),
        ("fx = 580.0", 'fx = "580"', "camera.fx"),
        ("fx = 580.0", "fx = -1.0", "outside"),
    ],
)
def test_a_wrong_file_is_refused(tmp_path: Path, before: str, after: str, message: str) -> None:
    text = (profiles_folder() / "kinect1.toml").read_text(encoding="utf-8")
    assert before in text
    path = tmp_path / "mine.toml"
    path.write_text(text.replace(before, after), encoding="utf-8")
    with pytest.raises(InputError, match=message):
        load_profile(path)


def test_custom_profile_is_found_by_its_path(tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    path.write_bytes((profiles_folder() / "tof.toml").read_bytes())
    assert load_profile(path) == load_profile(str(path)) == load_profile("tof")
    with pytest.raises(InputError, match="the file does not exist"):
        load_profile(tmp_path / "other.toml")
