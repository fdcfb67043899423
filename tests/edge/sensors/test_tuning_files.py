"""Tests that libcamera's tuning files contain the data that libcamera reads (its
src/ipa/rpi/controller/rpi).
"""

import itertools
import json
from pathlib import Path

import pytest

FILES = sorted((Path(__file__).parents[3] / "firmware_configs" / "libcamera").glob("*.json"))
KNOWN = {"black_level", "lux", "dpc", "noise", "geq", "denoise", "agc", "alsc", "contrast", "sharpen", "sync"}
"""Algorithms that a monochrome sensor may use."""
ZONES = {"pisp": 15 * 15, "bcm2835": 15}
"""Number of weights of a metering mode on the Raspberry Pi 5 and on older models."""


def rising(points: list[float], strictly: bool = True) -> bool:
    """Returns True if x0, y0, x1, y1, ... is a non-decreasing function."""
    steps = list(itertools.pairwise(zip(points[::2], points[1::2], strict=True)))
    return all(x0 < x1 and (y0 < y1 if strictly else y0 <= y1) for (x0, y0), (x1, y1) in steps)


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_a_tuning_file_has_what_libcamera_reads(path):
    tuning = json.loads(path.read_text())
    assert tuning["version"] == 2.0 and path.stem.endswith(tuning["target"])
    assert all(len(each) == 1 for each in tuning["algorithms"])
    algorithms = {name: values for each in tuning["algorithms"] for name, values in each.items()}
    assert set(algorithms) <= {f"rpi.{name}" for name in KNOWN}
    exposure = algorithms["rpi.agc"]
    for mode in exposure["metering_modes"].values():
        assert len(mode["weights"]) == ZONES[tuning["target"]]
    for mode in exposure["exposure_modes"].values():
        shutter, gain = mode["shutter"], mode["gain"]
        assert len(shutter) == len(gain) >= 2 and shutter == sorted(shutter) and gain == sorted(gain)
    for constraint in itertools.chain(*exposure["constraint_modes"].values()):
        assert constraint["bound"] in ("UPPER", "LOWER") and 0 <= constraint["q_lo"] < constraint["q_hi"] <= 1
        assert rising(constraint["y_target"], strictly=False)
    assert rising(exposure["y_target"], strictly=False)
    curve = algorithms["rpi.contrast"]["gamma_curve"]
    assert rising(curve) and curve[:2] == [0, 0] and curve[-2:] == [65535, 65535]


def test_the_one_for_two_cameras_keeps_them_in_step_sharp_and_steady():
    (path,) = [path for path in FILES if "stereo" in path.stem]
    algorithms = {k: v for each in json.loads(path.read_text())["algorithms"] for k, v in each.items()}
    # At 30 images per second with a message every ten images, cameras are synchronised within a second.
    assert algorithms["rpi.sync"]["sync_period"] <= 10
    # Half a period of 50 Hz light. In this time, a hand at 1 m/s and 2 m distance blurs over two pixels.
    assert max(algorithms["rpi.agc"]["exposure_modes"]["normal"]["shutter"]) == 10_000
    assert "rpi.denoise" not in algorithms and "rpi.sharpen" not in algorithms
