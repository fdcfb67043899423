"""``enliven sensors``: lists the sensors, or shows the image of one of them."""

from __future__ import annotations

import itertools
import json
import statistics
import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from enliven.commands.terminal import facts_table, make_plain_console, print_line
from enliven.errors import InputError, ResourceError
from enliven.files import write_picture

if TYPE_CHECKING:
    from rich.console import Console

    from enliven.arrays import Float, UInt8
    from enliven.frames import DepthFrame
    from enliven_edge.sensors import Condition, Sensor
    from enliven_edge.terminal.image_encoding import ImageProtocol

_PREVIEW_TIMEOUT_S = 15.0
"""Maximum seconds without a frame before a preview gives up. A camera may need ten seconds for its first
frame."""


def sensors(
    name: Annotated[
        str | None, typer.Argument(help="Sensor to preview. If omitted, all sensors are listed.")
    ] = None,
    setting: Annotated[
        list[str] | None, typer.Option("--set", help="Sensor option, KEY=VALUE. Repeat for several options.")
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", help="Write the depth image of the sensor to this .png file."),
    ] = None,
    seconds: Annotated[
        float, typer.Option(min=0.1, max=60.0, help="Duration of the preview in seconds.")
    ] = 2.0,
    picture: Annotated[
        str,
        typer.Option(
            help="How the terminal shows images: auto, none, kitty, iterm, sixel, blocks or blocks256."
        ),
    ] = "auto",
    as_json: Annotated[
        bool, typer.Option("--json", help="List the cameras as JSON, for another program.")
    ] = False,
) -> None:
    """List sensors and connected cameras, or describe one sensor and show its images.

    The terminal shows the depth image, in which near is bright. It uses an image protocol if it has one.

    \b
      enliven sensors
      enliven sensors oak
      enliven sensors synthetic -o depth.png
      enliven sensors replay --set path=TAKE.mcap
    """
    # Print without styles. Otherwise Rich would interpret the brackets of an extra in a pip command as a
    # style.
    console = make_plain_console()
    if as_json:
        import msgspec

        from enliven_edge.sensors import find_cameras

        typer.echo(json.dumps(msgspec.to_builtins(find_cameras())))
        return
    if name is None:
        _list_sensors(console)
        return
    from enliven_edge.sensors import open_sensor, sensor_options

    if output is not None and output.suffix != ".png":
        raise InputError(
            f"the file name ends in {output.suffix!r}",
            where=str(output),
            remedy="Use a name that ends in .png.",
        )
    protocol = _choose_protocol(picture)
    with open_sensor(name, **sensor_options(setting or [])) as sensor:
        frames = _read_frames(sensor, seconds)
        facts = _describe_sensor(frames, sensor.condition(), sensor.name)
    console.print(facts_table(facts))
    if protocol is not None:
        from enliven_edge.terminal.image_encoding import encode_image

        typer.echo(encode_image(_draw_picture(frames[-1]), protocol, console.width), nl=False, color=True)
    if output is not None:
        _write_picture_file(frames[-1], output, [f"{label}: {value}" for label, value in facts[:4]])
        print_line(f"{output}: depth image, near is bright")


def _list_sensors(console: Console) -> None:
    """Lists the names of sensors, and the devices that are plugged in."""
    from enliven_edge.sensors import list_attached, sensor_names
    from enliven_edge.sensors.drivers.libcamera_library import list_cameras

    facts = [("known", ", ".join(sensor_names()))]
    cameras = list_attached()
    for camera in cameras:
        problems = camera.find_problems()
        advice = (
            "; ".join(f"{problem}. {remedy}" for problem, remedy in problems)
            or f"--sensor {camera.kind.sensor}"
        )
        facts.append((camera.kind.name, f"{camera.title}: {advice}"))
    if not cameras:
        facts.append(("plugged in", "no depth camera on USB"))
    try:
        for number, camera_info in enumerate(list_cameras()):
            facts.append(
                (
                    "libcamera",
                    f"{camera_info.model} {camera_info.name}: --sensor libcamera --set left={number}",
                )
            )
    except ResourceError as error:
        facts.append(("libcamera", f"{error.what}. {error.remedy}"))
    console.print(facts_table(facts))


def _read_frames(sensor: Sensor, seconds: float) -> list[DepthFrame]:
    """Reads a sensor for ``seconds`` seconds and returns its depth frames, at least one."""
    from enliven.frames import DepthFrame
    from enliven_edge.sensors import SensorFault

    frames: list[DepthFrame] = []
    start = time.monotonic()
    end, give_up = start + seconds, start + _PREVIEW_TIMEOUT_S
    while time.monotonic() < end or (not frames and time.monotonic() < give_up):
        try:
            frame = sensor.read(0.25)
        except TimeoutError:
            continue
        except (SensorFault, InputError) as error:
            if not sensor.recorded:
                raise
            print_line(f"enliven: {error}", err=True)
            continue
        if frame is None:
            break
        if not isinstance(frame, DepthFrame):
            raise InputError(
                "the sensor sends bodies, but no depth images",
                where=sensor.name,
                remedy="To see the bodies, use: enliven edge",
            )
        frames.append(frame)
    if not frames:
        raise ResourceError(
            "the sensor sent no frame", where=sensor.name, remedy="Check the cable and power of the sensor."
        )
    return frames


def _describe_sensor(
    frames: list[DepthFrame], condition: Condition | None, name: str
) -> list[tuple[str, str]]:
    """Returns facts about a sensor for the user, as pairs of label and value."""
    import numpy as np

    from enliven.camera import pixel_rays, unproject_depth
    from enliven_edge.tracking.frame.reduction import measure_depth_image
    from enliven_edge.tracking.scene.floor import world_from_floor

    last = frames[-1]
    steps = [1e-9 * (b.time_ns - a.time_ns) for a, b in itertools.pairwise(frames)]
    facts = [("sensor", name), ("image", f"{last.intrinsics.width} x {last.intrinsics.height}")]
    if steps and statistics.median(steps) > 0:
        facts.append(("rate", f"{1 / statistics.median(steps):.1f} frames a second"))
    known_fraction = statistics.median(measure_depth_image(frame.depth).known_fraction for frame in frames)
    facts.append(("depth", f"measured in {100 * known_fraction:.0f} % of the image"))
    metres = last.depth[(last.depth > 0) & (last.depth < 65535)] * 1e-3
    if len(metres):
        near, far = np.percentile(metres, (1, 99))
        facts.append(("distances", f"{near:.2f} to {far:.2f} m"))
    points = unproject_depth(last.depth, pixel_rays(last.intrinsics)).reshape(-1, 3)
    level_from_camera = world_from_floor(points[points[:, 2] > 0])
    down = None if level_from_camera is None else -level_from_camera[1, :3]
    if level_from_camera is None or down is None:
        facts.append(("floor", "not visible; tilt the sensor until the floor is in view"))
    else:
        tilt = np.degrees(np.arcsin(np.clip(down[2], -1, 1)))
        facts.append(
            (
                "floor",
                f"{level_from_camera[1, 3]:.2f} m below the sensor, which is tilted down by {tilt:.0f} "
                "degrees",
            )
        )
    if condition is not None:
        facts += describe_condition(condition, down)
    return facts


def describe_condition(condition: Condition, down: Float | None) -> list[tuple[str, str]]:
    """Returns the names and texts of a sensor's known properties, such as its link and its tilt.

    Args:
        down: (3,) direction of gravity in the sensor's frame if it was found in the image.
    """
    import numpy as np

    facts = []
    if condition.link:
        facts.append(("link", condition.link + (", which is slow" if condition.slow_link else "")))
    if condition.temperature is not None:
        facts.append(("temperature", f"{condition.temperature:.0f} degrees"))
    if condition.gravity is not None:
        gravity_direction = np.array(condition.gravity) / np.linalg.norm(condition.gravity)
        tilt = np.degrees(np.arcsin(np.clip(gravity_direction[2], -1, 1)))
        gravity_text = f"sensor tilted down by {tilt:.0f} degrees, by its accelerometer"
        if down is not None:
            angle = np.degrees(np.arccos(np.clip(gravity_direction @ down, -1, 1)))
            gravity_text += f"; {angle:.0f} degrees from the floor's normal"
        facts.append(("gravity", gravity_text))
    return facts


def _choose_protocol(name: str) -> ImageProtocol | None:
    """Returns the image protocol to draw with, or None if no picture is drawn."""
    from enliven_edge.terminal.image_encoding import IMAGE_PROTOCOLS
    from enliven_edge.terminal.protocol_query import image_protocol

    if name in ("auto", "none"):
        return image_protocol(sys.stdout, sys.stdin) if name == "auto" else None
    if name not in IMAGE_PROTOCOLS:
        choices = ", ".join(("auto", "none", *IMAGE_PROTOCOLS))
        raise InputError(
            f"{name!r} is not a known image protocol", where="--picture", remedy=f"Use one of: {choices}."
        )
    return name  # type: ignore[return-value]


def _draw_picture(frame: DepthFrame) -> UInt8:
    """Returns (H, W, 3) sRGB of a frame's depth, with the colour image to the right if the frame has
    colour.
    """
    import numpy as np
    from PIL import Image

    from enliven_edge.inspection.picture import depth_picture, depth_span

    depth_image = depth_picture(frame.depth, *depth_span(frame.depth))
    if frame.colour is None:
        return depth_image
    colour = Image.fromarray(frame.colour).resize((depth_image.shape[1], depth_image.shape[0]))
    return np.hstack([depth_image, np.asarray(colour)])


def _write_picture_file(frame: DepthFrame, output: Path, lines: list[str]) -> None:
    from PIL import Image

    from enliven_edge.inspection.picture import add_caption

    write_picture(output, Image.fromarray(add_caption(_draw_picture(frame), lines)))
