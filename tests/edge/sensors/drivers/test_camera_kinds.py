"""Tests that drivers use the known properties of each camera model, and of some drivers' own features."""

import importlib

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from libraries import LIBRARIES, needs
from troubled import camera, picture

from enliven.errors import InputError
from enliven.frames import DepthFrame
from enliven.recording import Recorder
from enliven_edge.sensors.drivers import oak, orbbec, realsense
from enliven_edge.sensors.drivers.lens import create_range_filter, profile_from_name
from enliven_edge.sensors.drivers.tof import TofSensor
from enliven_synthesis.sensor.profile import load_profile

NAMES = [
    (oak.KINDS, "oak-d", "OAK-D-LITE", "OAK-D Lite"),
    (oak.KINDS, "oak-d", "OAK-D-POE", "OAK-D"),
    (realsense.KINDS, "realsense-d435", "Intel RealSense D415", "RealSense D415"),
    (realsense.KINDS, "realsense-d435", "Intel RealSense D435I", "RealSense D435"),
    (realsense.KINDS, "realsense-d435", "Intel RealSense D455", "RealSense D455"),
    (realsense.KINDS, "realsense-d435", "Intel RealSense D405", "RealSense D405"),
    (orbbec.KINDS, "orbbec-gemini335", "Orbbec Gemini 2", "Orbbec Gemini 2"),
    (orbbec.KINDS, "orbbec-gemini335", "Orbbec Gemini 335Lg", "Orbbec Gemini 335"),
    (orbbec.KINDS, "orbbec-gemini335", "Orbbec Astra 2", "Orbbec Astra 2"),
    (orbbec.KINDS, "orbbec-gemini335", "Orbbec Femto Bolt", "Orbbec Femto Mega, Femto Bolt"),
]


@pytest.mark.parametrize(("kinds", "otherwise", "called", "profile"), NAMES)
def test_a_camera_gets_the_profile_of_its_kind(kinds, otherwise, called, profile):
    assert load_profile(profile_from_name(called, kinds, otherwise)).name == profile


EDGES = [each + by for each in (500, 700, 1000, 2000, 3100, 5460) for by in (-1, 0, 1)]
"""Depths in millimetres around the limits of the ranges below."""


@given(
    st.lists(st.sampled_from(EDGES) | st.integers(0, 65535), min_size=1, max_size=50),
    st.sampled_from([(0.0, 0.0), (1.0, 0.0), (0.0, 2.0), (0.7, 3.1)]),
    st.booleans(),
)
def test_depths_out_of_reach_are_unknown_and_the_others_stay(values, reach, rehearsed):
    typical = load_profile("orbbec-femto-mega").range
    near = reach[0] or (0.0 if rehearsed else typical.near)
    far = reach[1] or (65.535 if rehearsed else typical.far)
    depth = np.array(values, np.uint16)
    kept = create_range_filter(reach, "orbbec-femto-mega", rehearsed)(depth)
    for before, after in zip(values, kept.tolist(), strict=True):
        assert after == (before if round(1000 * near) <= before <= round(1000 * far) else 0)


def test_an_empty_reach_is_refused():
    with pytest.raises(InputError, match=r"near is 3.0 m and far is 2.0 m"):
        create_range_filter((3.0, 2.0), "arducam-tof", False)


@pytest.fixture(scope="module")
def played(tmp_path_factory) -> str:
    """Returns frames of a recording of a depth camera, 96x64."""
    path = tmp_path_factory.mktemp("played") / "take.mcap"
    with Recorder(path) as recorder:
        for number in range(8):
            frame = DepthFrame(picture(number, 96, 64), camera(96, 64, 80.25), number * 10**8, "test")
            recorder.write_frame(frame)
    return str(path)


@pytest.mark.slow
@given(
    st.integers(0, 2**32 - 1),
    st.sampled_from([(0.0, 0.0), (1.0, 0.0), (0.0, 2.0), (0.7, 3.1)]),
    st.sampled_from([0, 30, 40.5]),
)
def test_a_depth_of_little_confidence_or_out_of_reach_is_unknown(played, seed, reach, least):
    """Compared with a slow reference, with values around every threshold, halves and NaN."""
    random = np.random.default_rng(seed)
    odd = [np.nan, np.inf, -np.inf, -0.4, 0.4, 0.5, 65534.4, 65534.5, 65534.99, 65535.0, *EDGES]
    confidence = random.choice([least - 1, np.nextafter(np.float32(least), -1), least, 255, np.nan], (64, 96))
    depth = random.uniform(-50.0, 70_000.0, (64, 96)) // 0.5 * 0.5
    depth[:32] = random.choice(odd, (32, 96)) + random.choice([-0.5, -0.1, 0.0, 0.5], (32, 96))
    depth, confidence = depth.astype(np.float32), confidence.astype(np.float32)
    with TofSensor(rehearse=played, confidence=least, near=reach[0], far=reach[1]) as sensor:
        trusted = sensor.filter_depth(depth, confidence)
        with pytest.raises(InputError, match="shapes"):
            sensor.filter_depth(depth[1:], confidence)
    low, high = 1000 * reach[0], 1000 * reach[1] or 65535
    for actual, exact, sure in zip(trusted.ravel(), depth.ravel(), confidence.ravel(), strict=True):
        rounded = np.rint(exact)
        is_known = sure >= least and round(low) <= rounded <= round(high)
        assert actual == (rounded if is_known else 0)


@pytest.mark.parametrize(
    ("options", "words"),
    [({"range": 3}, "range cannot be 3 m"), ({"near": 3.0, "far": 1.0, "rehearse": "x"}, "near is 3.0 m")],
)
def test_unsupported_time_of_flight_options_are_refused(options, words):
    with pytest.raises(InputError, match=words):
        TofSensor(**options)


ASKED = {
    "orbbec": {
        "Context": "query_devices create_net_device set_device_changed_callback set_logger_to_file",
        "DeviceList": "get_device_by_index get_device_serial_number_by_index get_device_name_by_index "
        "get_device_uid_by_index get_device_ip_address_by_index get_device_user_name_by_index",
        "Device": "get_device_info get_temperature get_sensor get_sensor_list load_preset "
        "get_available_preset_list get_multi_device_sync_config set_multi_device_sync_config",
        "DevicePresetList": "get_name_by_index",
        "OBMultiDeviceSyncConfig": "mode",
        "DeviceInfo": "get_uid get_serial_number get_name get_connection_type",
    },
    "tof": {
        "ArducamCamera": "open start stop close setControl getControl getCameraInfo requestFrame "
        "releaseFrame",
        "CameraInfo": "width height",
        "DepthData": "depth_data confidence_data",
        "Control": "RANGE INTRINSIC_FX INTRINSIC_FY INTRINSIC_CX INTRINSIC_CY",
        "TofErrorCode": "ArducamSuccess ArducamNoPermission ArducamUnkownDevice ArducamNoCache",
        "Connection": "CSI",
        "FrameType": "DEPTH",
    },
}
"""Attributes that a driver uses only if a device is connected, by class."""


@pytest.mark.parametrize("driver", ASKED)
def test_a_library_has_what_only_a_device_would_show(driver):
    needs(driver)
    library = importlib.import_module(LIBRARIES[driver])
    for kind, words in ASKED[driver].items():
        missing = [word for word in words.split() if not hasattr(getattr(library, kind), word)]
        assert not missing, f"{kind} has no {', '.join(missing)}"
