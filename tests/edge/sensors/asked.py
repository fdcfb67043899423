"""A process that requests unavailable features of the cameras' real libraries, and prints the drivers'
errors.

It is a separate process because the libraries set signal handlers and leave threads behind. The first word of
its command line is a folder with recordings and simulated USB trees. Its output is JSON.
"""

import json
import sys
from collections.abc import Callable
from pathlib import Path

from enliven.errors import EnlivenError
from enliven_edge.sensors.attached_cameras import list_attached
from enliven_edge.sensors.drivers import refusals
from enliven_edge.sensors.drivers.oak import OakSensor
from enliven_edge.sensors.drivers.orbbec import OrbbecSensor
from enliven_edge.sensors.drivers.realsense import RealSenseSensor
from enliven_edge.sensors.drivers.realsense_library import depth_mode


def say(ask: Callable[[], object]) -> list[str]:
    """Returns the error's class, message and exit code, or the returned value."""
    try:
        return ["", str(ask()), "0"]
    except EnlivenError as error:
        return [type(error).__name__, str(error), str(error.exit_code)]


def on_usb(folder: Path, name: str) -> None:
    """Makes the system list the cameras of a simulated USB tree."""
    refusals.list_attached = lambda: list_attached(folder / name / "devices", folder / name / "nodes")


def opened_twice() -> object:
    """Triggers librealsense's error for a stream that is already open."""
    with RealSenseSensor(rehearse=str(folder / "lensless-realsense.mcap")) as sensor:
        stream = depth_mode(sensor._rs, sensor._depth, (320, 240, 30), sensor.name)
        return sensor._open(sensor._depth, stream, sensor._images)


def on_usb_2() -> object:
    """Creates a software device that reports a USB 2 connection."""
    with RealSenseSensor(rehearse=str(folder / "lensless-realsense.mcap")) as sensor:
        sensor._device.register_info(sensor._rs.camera_info.usb_type_descriptor, "2.1")
        condition = sensor.condition()
        return [condition.link, condition.slow_link]


def lensless(kind: type, name: str) -> object:
    """Returns the lens used for a device without calibration data, and the reported warning."""
    with kind(rehearse=str(folder / f"lensless-{name}.mcap")) as sensor:
        while True:
            try:
                camera = sensor.read(0.2).intrinsics
            except TimeoutError:
                continue
            return [camera.width, camera.fx, sensor.condition().calibrated]


KINDS: dict[str, tuple[type, str, str]] = {
    "oak": (OakSensor, "device", "14442C10D13EABCE00"),
    "realsense": (RealSenseSensor, "serial", "012345678901"),
    "orbbec": (OrbbecSensor, "device", "CP3S34D00012"),
}

if __name__ == "__main__":
    folder, sensor = Path(sys.argv[1]), sys.argv[2]
    kind, option, name = KINDS[sensor]
    said = {}
    for tree in ("nothing", "forbidden", "hidden"):
        on_usb(folder, tree)
        said[tree] = say(kind)
    on_usb(folder, "nothing")
    said["another"] = say(lambda: kind(**{option: name}))
    said["lensless"] = say(lambda: lensless(kind, sensor))
    if sensor == "realsense":
        said["open already"] = say(opened_twice)
        said["USB 2"] = say(on_usb_2)
    print(json.dumps(said))
