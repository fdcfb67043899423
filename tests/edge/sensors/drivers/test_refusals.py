"""Tests of the errors for unavailable cameras: each problem has a message with advice."""

import errno
import importlib.util
import json
import mmap
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest
from asked import KINDS
from contract import DRIVERS, usable
from hypothesis import given
from hypothesis import strategies as st
from patience import wait_until
from troubled import camera, picture

from enliven.errors import InputError, ResourceError
from enliven.frames import DepthFrame
from enliven.recording import Recorder
from enliven_edge.sensors import attached_cameras as cameras
from enliven_edge.sensors.drivers import refusals
from enliven_edge.sensors.drivers.lens import choose_intrinsics
from enliven_edge.sensors.drivers.refusals import (
    LIBRARY_MESSAGES,
    SYSTEM_MESSAGES,
    choose_device,
    convert_error,
)
from enliven_edge.sensors.registry import open_sensor, sensor_opener
from enliven_edge.sensors.reopening import open_reopening

LIBRARIES = {driver.name: driver for driver in DRIVERS if driver.needs[0]}
MESSAGES = [
    ("oak", "No available devices (1 connected, but in use)", "another program uses the camera. Close"),
    ("oak", 'Cannot connect to device with name "1.1", it is used by another process. Error: X', "Close"),
    ("oak", "Failed to connect to device, error message: X_LINK_DEVICE_ALREADY_IN_USE", "another program"),
    (
        "oak",
        'Insufficient permissions to communicate with X_LINK_UNBOOTED device with name "1.1". Make sure udev '
        "rules are set. Error: X_LINK_INSUFFICIENT_PERMISSIONS",
        "your user may not open the camera. Type: sudo cp firmware_configs/udev",
    ),
    (
        "oak",
        "Failed to find device after booting, error message: X_LINK_DEVICE_NOT_FOUND",
        "does not reconnect after",
    ),
    (
        "oak",
        "Couldn't read data from stream: '__x_0' (X_LINK_ERROR)",
        "the connection to the camera broke. Use another USB 3",
    ),
    ("oak", "Device 1844301041 (OAK-1) does not have stereo pair available", "no stereo pair"),
    ("realsense", "failed to open usb interface: 0, error: RS2_USB_STATUS_ACCESS", "your user may not open"),
    (
        "realsense",
        "Unable to claim interface 0, error: RS2_USB_STATUS_BUSY",
        "another program uses the camera",
    ),
    ("realsense", "xioctl(VIDIOC_S_FMT) failed, errno=16 Last Error: Device or resource busy", "another"),
    (
        "realsense",
        "Couldn't resolve requests",
        "cannot send the requested images on this port. Use a USB 3 port",
    ),
    (
        "realsense",
        "Device disconnected. Failed to reconnect: ",
        "no longer connected. Plug the camera in again",
    ),
    ("orbbec", "[usb] Access denied (insufficient permissions)", "your user may not open the camera"),
    (
        "orbbec",
        "usbEnumerator openUsbDevice failed!",
        "the camera cannot be opened. Close other programs that use the camera",
    ),
    (
        "orbbec",
        "Device is deactivated/disconnected!\n code 2",
        "no longer connected. Plug the camera in again",
    ),
    ("other", "[Errno 13] Permission denied: '/dev/video0'", "your user may not open the camera"),
    ("other", "[Errno 19] No such device", "no longer connected"),
    ("other", "Frobnication failed", "the camera cannot be used (Frobnication failed). Unplug the camera"),
]
"""(sensor, message of its library, our message)."""


@pytest.mark.parametrize(("sensor", "message", "words"), MESSAGES)
def test_library_message_becomes_an_error_with_advice(sensor, message, words):
    error = convert_error(sensor, RuntimeError(message), "left camera")
    assert words in str(error) and str(error).startswith("left camera: ")
    assert error.exit_code == 4 and error.remedy


def test_every_message_has_an_explanation():
    sentences = {str(convert_error(sensor, RuntimeError(message))) for sensor, message, _ in MESSAGES}
    assert len(sentences) >= 10
    for pieces in LIBRARY_MESSAGES.values():
        assert len(dict(pieces)) == len(pieces)


def test_system_errors_are_explained():
    if sys.platform.startswith("linux"):
        codes = (errno.EACCES, errno.EPERM, errno.EBUSY, errno.ENODEV, errno.ENOENT)
        assert [piece for piece, _ in SYSTEM_MESSAGES] == [os.strerror(code) for code in codes]


@pytest.mark.parametrize("driver", LIBRARIES.values(), ids=LIBRARIES)
def test_library_messages_still_exist(driver):
    """Every part of a message occurs in the installed library, so an update that rewords it fails here."""
    module = importlib.util.find_spec(usable(driver).needs[0])
    near = Path(module.origin).parent
    own = [near] if module.submodule_search_locations else [near / f"{module.name}.libs"]
    files = [p for folder in own for p in folder.glob("*.so*") if "debug" not in p.name] + [module.origin]
    left = {piece.encode() for piece, _ in LIBRARY_MESSAGES[driver.name]}
    for path in files:
        with open(path, "rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as held:
            left = {piece for piece in left if held.find(piece) < 0}
    assert not left


names = st.text("0123456789ABCDEF", min_size=1, max_size=6)


@given(found=st.dictionaries(names, st.integers(), max_size=4), wanted=names | st.just(""), before=names)
def test_the_camera_that_is_meant_or_none(found, wanted, before):
    """The requested camera; otherwise the only one, or the previous one; never another."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(refusals, "list_attached", list)
        may = wanted in found if wanted else len(found) == 1 or before in found
        if may:
            meant = wanted or (before if before in found else next(iter(found)))
            assert choose_device("oak", "an OAK", found, wanted, "device", before) == found[meant]
            return
        with pytest.raises(ResourceError) as raised:
            choose_device("oak", "an OAK", found, wanted, "device", before)
    reason = str(raised.value)
    assert all(name in reason for name in found) and ("--set " in reason) == bool(found) and wanted in reason


def test_two_cameras_of_one_name_are_reported_with_advice():
    with pytest.raises(ResourceError) as raised:
        choose_device("oak", "an OAK", {"A1": 0, "B2": 1}, "", "device")
    reason = str(raised.value)
    assert "2 cameras are connected: A1, B2" in reason and "--set device=A1" in reason
    assert "--sensor left=oak --sensor right=oak --set left.device=A1 --set right.device=B2" in reason


@pytest.mark.parametrize(
    ("sensor", "package", "version", "why"),
    [
        ("oak", "depthai", "3.8.0", "an OAK-D Lite sends no depth"),
        ("oak", "depthai", "2.29.0.0", "needs depthai 3"),
        ("realsense", "pyrealsense2", "2.50.0.3785", "needs version 2.56"),
    ],
)
def test_unsupported_library_version_is_reported(monkeypatch, sensor, package, version, why):
    """The error is reported before the library is loaded."""
    monkeypatch.setattr(cameras, "version", {package: version}.__getitem__)
    with pytest.raises(ResourceError) as raised:
        cameras.import_library(package, sensor)
    reason = str(raised.value)
    assert f"{package} {version} is installed" in reason and why in reason
    assert f'pip install "enliven-edge[{sensor}]"' in reason


def test_working_versions_are_accepted():
    good = {
        "depthai": ("3.6.1", "3.7.0", "3.11.0", "3.12.0"),
        "pyrealsense2": ("2.56.5.9235", "2.59.1.11053"),
    }
    assert not any(
        cameras.explain_unsupported(package, v) for package, versions in good.items() for v in versions
    )


@pytest.fixture(scope="module", params=LIBRARIES)
def said(request, tmp_path_factory):
    """Returns the sensor, and its driver's errors with the real library without a device, by USB state."""
    driver = usable(LIBRARIES[request.param])
    folder = tmp_path_factory.mktemp("asked")
    plugged(folder / "nothing")
    plugged(folder / "forbidden", allowed=False)
    plugged(folder / "hidden", allowed=True)
    size = {"oak": (320, 200), "realsense": (320, 240), "orbbec": (320, 288)}[driver.name]
    with Recorder(folder / f"lensless-{driver.name}.mcap") as recorder:
        for number in range(30):
            recorder.write_frame(
                DepthFrame(picture(0, *size), camera(*size, 1.0), number * 33_333_333, "test")
            )
    asked = [sys.executable, str(Path(__file__).parents[1] / "asked.py"), str(folder), driver.name]
    around = {**os.environ, "DEPTHAI_SEARCH_TIMEOUT": "200"}
    done = subprocess.run(asked, env=around, capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 0, done.stderr
    return driver.name, json.loads(done.stdout.splitlines()[-1])


def plugged(folder: Path, allowed: bool | None = None) -> None:
    """Creates a simulated USB tree with an OAK, a RealSense and an Orbbec camera, or an empty one."""
    titles = {"03e7": "Luxonis Device", "8086": "Intel RealSense D435", "2bc5": "Orbbec Gemini 335"}
    for number, (vendor, title) in enumerate(titles.items()):
        device = folder / "devices" / f"1-{number}"
        device.mkdir(parents=True)
        about = {"idVendor": vendor, "idProduct": "f63b", "product": title, "serial": "S7"} | {
            "speed": "5000",
            "busnum": "1",
            "devnum": str(number),
        }
        for part, text in about.items() if allowed is not None else ():
            (device / part).write_text(text)
        if allowed:
            (folder / "nodes" / "001").mkdir(parents=True, exist_ok=True)
            (folder / "nodes" / "001" / f"{number:03}").touch()


@pytest.mark.slow
def test_missing_camera_gives_advice_and_command(said):
    sensor, reports = said
    kind, words, code = reports["nothing"]
    assert (kind, code) == ("ResourceError", "4") and "is not connected" in words
    assert "USB 3 port" in words and f"enliven run --sensor {sensor}" in words and "enliven doctor" in words


@pytest.mark.slow
def test_other_camera_than_requested_is_reported(said):
    sensor, reports = said
    kind, words, _ = reports["another"]
    assert kind == "ResourceError" and f"called {KINDS[sensor][2]} is not connected" in words


def test_forbidden_and_hidden_cameras_are_reported(said):
    _, reports = said
    assert "S7: your user may not open the camera. Type: sudo cp" in reports["forbidden"][1]
    assert (
        "S7 is plugged in, but the library of the camera does not find it. "
        "Close other programs that use the camera" in reports["hidden"][1]
    )


def test_camera_without_calibration_uses_a_default_lens(said):
    """The camera runs with the default lens of its model, which is reported."""
    _, reports = said
    width, focal, calibrated = json.loads(reports["lensless"][1].lower())
    assert width == 320 and 180 < focal < 260 and calibrated is False


def test_librealsense_reports_open_stream_and_usb2(said):
    sensor, reports = said
    if sensor != "realsense":
        pytest.skip("depthai has no device of software")
    said = (
        "the library of the camera cannot play the recording (open(...) failed. Software device is "
        "streaming!). Rehearse"
    )
    assert said in reports["open already"][1]
    assert reports["USB 2"][1] == "['USB 2.1', True]"


@pytest.mark.parametrize("sensor", LIBRARIES)
@pytest.mark.parametrize("options", [{"rehearse": "nothing.mcap"}, {"widht": 640}])
def test_unusable_driver_options_are_refused(sensor, options):
    if "rehearse" in options:
        usable(LIBRARIES[sensor])
    with pytest.raises(InputError, match=r"nothing\.mcap|Did you mean width"):
        open_reopening(sensor_opener(sensor, **options))


def test_a_camera_that_does_not_know_its_lens_gets_that_of_its_kind():
    lens, is_known = choose_intrinsics(640, 400, (450.0, 451.0, 320.0, 200.0), "oak-d", "oak 1")
    assert is_known and (lens.fx, lens.fy) == (450.0, 451.0)
    typical, is_known = choose_intrinsics(320, 200, (1.0, 1.0, 0.0, 0.0), "oak-d", "oak 1")
    assert not is_known and typical.width == 320 and 200 < typical.fx < 240
    for rehearsed, remedy in (
        (False, "Set the image size to 640x400, or cal"),
        (True, "Rehearse with .* or with a recording of 640x400"),
    ):
        with pytest.raises(InputError, match=rf"oak 1: the lens of the camera is unknown.* {remedy}"):
            choose_intrinsics(640, 480, (1.0, 1.0, 0.0, 0.0), "oak-d", "oak 1", rehearsed)


@pytest.mark.slow
@pytest.mark.parametrize("sensor", LIBRARIES)
def test_rehearsal_without_a_lens_gives_advice(tmp_path, sensor):
    """A recording cannot change its size, so neither a port nor a cable is named as the cause."""
    usable(LIBRARIES[sensor])
    with Recorder(tmp_path / "square.mcap") as recorder:
        for number in range(3):
            frame = DepthFrame(picture(0, 100, 100), camera(100, 100, 1.0), number * 33_333_333, "test")
            recorder.write_frame(frame)
    errors: list[Exception] = []
    try:
        with open_sensor(sensor, rehearse=str(tmp_path / "square.mcap")) as playing:
            wait_until(lambda: seen(playing, errors), "what is said of its lens")
    except InputError as error:
        errors.append(error)
    reason = str(errors[0])
    assert "the lens of the camera is unknown" in reason and "a recording that describes its lens" in reason
    assert not any(word in reason for word in ("Ask for", "Unplug", "cable", "port"))


def seen(sensor, errors: list[Exception]) -> bool:
    """Returns True if an image or an error arrived. Stores the error."""
    try:
        return sensor.read(0.1) is None
    except TimeoutError:
        return False
    except InputError as error:
        errors.append(error)
        return True


@pytest.mark.parametrize("sensor", LIBRARIES)
@pytest.mark.parametrize("message", [message for _, message, _ in MESSAGES])
def test_rehearsal_gives_no_hardware_advice(sensor, message):
    refusal = str(convert_error(sensor, RuntimeError(message), "a rehearsal", rehearsed=True))
    assert " ".join(message.split()).rstrip(".") in refusal and "enliven inspect" in refusal
    assert not any(word in refusal for word in ("Plug the", "Unplug the", "Close", "cable", "Type: sudo"))


@pytest.mark.slow
def test_a_recording_that_is_not_rectified_is_none_of_an_oak(tmp_path):
    usable(LIBRARIES["oak"])
    lens = replace(camera(96, 64), distortion=(0.1, 0.0, 0.0, 0.0, 0.0))
    with Recorder(tmp_path / "bent.mcap") as recorder:
        recorder.write_frame(DepthFrame(picture(0, 96, 64), lens, 0, "test"))
    with pytest.raises(InputError, match="not rectified"):
        open_reopening(sensor_opener("oak", rehearse=str(tmp_path / "bent.mcap")))
