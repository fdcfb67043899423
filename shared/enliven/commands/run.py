"""The command ``enliven run``: starts and ends the edge and the viewer together, as two processes."""

from __future__ import annotations

import importlib.util
import os
import re
import sys
from pathlib import Path
from typing import Any, Literal

import typer

from enliven.commands.part_names import check_parts
from enliven.commands.processes import Process, is_listening, run_together
from enliven.commands.terminal import print_line
from enliven.errors import InputError, ResourceError
from enliven.files import require_folder
from enliven.wire import free_ports

_FILM_SECONDS = 10.0
"""Default length of a film, in seconds. The shipped recording has nine seconds, so its end is included."""
_OUTPUT = re.compile(r"[A-Za-z]{2,}:")
"""Pattern of the start of a live output's address, such as "vmc:". A folder with such a name can be written
as ./NAME."""
_COMPILE_TIMEOUT_S = 3600.0
"""Maximum time in seconds to wait until an edge has compiled all kernels. On a small machine with a load of
10, it took more than 600 s. An edge that fails ends the wait immediately."""


def run(
    recording: Path | None = typer.Option(
        None, help="Recording to replay. Default: the recording that comes with enliven."
    ),
    sensor: str | None = typer.Option(None, help="Use this sensor instead of a recording."),
    option: list[str] | None = typer.Option(
        None, "--set", help="Option of the sensor, as KEY=VALUE. Can be repeated."
    ),
    mesh: list[str] | None = typer.Option(
        None,
        help="Mesh file, 'chair', 'lamp', or a puppet (session, project, or 'cactus'). Can be repeated.",
    ),
    possess_at: float = typer.Option(
        1.5, help="Time after the first frame at which the mesh is possessed, in seconds."
    ),
    parts: list[str] | None = typer.Option(
        None,
        help="Body parts that possess the mesh: 'legs', 'upper body', ... Default: all.",
        callback=check_parts,
    ),
    out: list[str] | None = typer.Option(
        None,
        help=(
            "Folder for the film and the contact sheet (default: out), or address of a program "
            "that receives the motion live, such as vmc:127.0.0.1. Can be repeated."
        ),
    ),
    film: bool | None = typer.Option(
        None,
        "--film/--window",
        help="Make a film or open a window. Default: a window if the computer has a display.",
    ),
    seconds: float | None = typer.Option(None, help="Stop after this many seconds of the recording."),
    size: str | None = typer.Option(
        None, help="Size of the window or film, such as 640x360. A smaller size draws faster."
    ),
    up: Literal["x", "y", "z"] | None = typer.Option(
        None, help="Axis of the meshes that points up. Default: guessed."
    ),
    physics: str | None = typer.Option(
        None, help="Loose objects that characters can knock over: boxes or dodgeball."
    ),
    drive: list[str] | None = typer.Option(
        None, help="Rig that moves the mesh: graph (deformation graph), or skeleton (of a rigged glTF)."
    ),
    settings: Path | None = typer.Option(None, help="Settings of the edge (TOML file)."),
    record: Path | None = typer.Option(
        None,
        help=(
            "Save the take (character, bodies and poses) to this file. {time} and {number} in the "
            "name are replaced."
        ),
    ),
    overwrite: bool = typer.Option(False, "--overwrite", help="Replace an existing take file."),
) -> None:
    """Start the edge and the viewer together, and move a mesh by a recorded or live performer.

    With a display the viewer opens a window. Without one it renders off-screen and writes
    out/enliven.mp4 and out/enliven.png. If the edge fails while a window is open, the window
    stays open, and the edge is restarted.

    \b
      enliven run
      enliven run --recording TAKE.mcap --mesh HORSE.obj --possess-at 2
      enliven run --sensor synthetic --window
      enliven run --sensor oak --set rehearse=TAKE.mcap
      enliven run --physics boxes
      enliven run --film --size 640x360
      enliven run --mesh HORSE.obj --settings EDGE.toml
      enliven run --mesh SPIDER.glb --drive skeleton --parts arms
      enliven run --mesh cactus
      enliven run --out vmc:127.0.0.1 --out osc:192.168.1.20:7000
      enliven run --mesh chair --mesh lamp
      enliven run --mesh CACTUS.toml --recording TAKE.mcap
    """
    _check_programs()
    for label, path in (("recording", recording), ("settings file", settings)):
        if path is not None and not path.exists():
            raise InputError(f"the {label} does not exist", where=str(path), remedy="Check the path.")
    folder, outputs = _folder_and_outputs(out or [])
    require_folder(folder, record)
    as_film = not has_display() if film is None else film
    if as_film and film is None:
        print_line("enliven: no display was found, so a film is made instead of opening a window")
    if as_film and seconds is None and sensor is not None:
        seconds = _choose_film_length(option or [])
    if as_film:
        folder.mkdir(exist_ok=True)
    ports = free_ports()
    port_options = {"port": ports[0], "control_port": ports[1]}
    mesh_options: dict[str, Any] = {"mesh": mesh, "parts": parts, "drive": drive, "physics": physics}
    mesh_options |= {"possess_at": possess_at, "up": up}
    source_options: dict[str, Any] = {
        "sensor": sensor,
        "set": option,
        "recording": None if sensor else recording,
    }
    source_options |= {"seconds": seconds, "loop": seconds is None and sensor is None and not as_film}
    # For a film, the edge waits for the viewer before it starts, so that no frame is lost.
    edge_options = {
        "record": record,
        "overwrite": overwrite,
        "settings": settings,
        "name": f"run-{os.getpid()}",
        "wait_for_viewer": 60,
        "out": outputs,
    }
    edge_command = _command_line("edge", **source_options, **mesh_options, **edge_options, **port_options)
    edge_restart = _command_line(
        "edge",
        **source_options,
        **mesh_options,
        **{**edge_options, "record": _restart_take_path(record)},
        **port_options,
    )
    film_to = {
        "film": folder / "enliven.mp4",
        "sheet": folder / "enliven.png",
        "wait": f"{_COMPILE_TIMEOUT_S:g}",
    }
    view_command = _command_line(
        "view", edge=["127.0.0.1"], **(film_to if as_film else {}), **port_options, size=size
    )
    # The edge compiles its kernels and prepares the mesh before it listens on its port. This takes a minute
    # at the first start.
    processes = [
        Process(
            "edge",
            edge_command,
            restart_arguments=None if as_film else edge_restart,
            ready=lambda: as_film or is_listening("127.0.0.1", ports[0]),
        ),
        Process("viewer", view_command, leads=True),
    ]
    code = run_together(processes)
    if code:
        raise typer.Exit(code)
    if as_film:
        print_line(f"enliven: film: {folder / 'enliven.mp4'}, contact sheet: {folder / 'enliven.png'}")


def _choose_film_length(sensor_options: list[str]) -> float | None:
    """Returns the seconds after which the film of a sensor ends, with a message.

    Returns None if the sensor plays a recording, because the film then ends with it.
    """
    if any(text.startswith("rehearse=") for text in sensor_options):
        return None
    print_line(
        f"enliven: a sensor has no end, so the film ends after {_FILM_SECONDS:g} s. To change this, "
        "use --seconds"
    )
    return _FILM_SECONDS


def _folder_and_outputs(words: list[str]) -> tuple[Path, list[str]]:
    """Returns the folder of the film and the addresses of live outputs, from the values of ``--out``.

    An address begins with the name of a protocol and a colon. A single letter before the colon is a Windows
    drive.
    """
    outputs = [word for word in words if _OUTPUT.match(word)]
    folders = [word for word in words if not _OUTPUT.match(word)]
    return Path(folders[-1] if folders else "out"), outputs


def _restart_take_path(record: Path | None) -> Path | None:
    """Returns the path for the take of a restarted edge. It differs from the path of the earlier take, which
    is kept."""
    if record is None or "{number}" in record.name or "{time}" in record.name:
        return record
    return record.with_stem(f"{record.stem}-restart{{number}}")


def has_display() -> bool:
    """Returns True if a window can be opened on this machine."""
    if sys.platform in ("win32", "darwin"):
        return True
    return bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))


def _check_programs() -> None:
    for package, name in (("enliven_edge", "enliven-edge"), ("enliven_viewer", "enliven-viewer")):
        if importlib.util.find_spec(package) is None:
            raise ResourceError(
                f"the package {name} is not installed on this computer",
                remedy=f"Type: pip install {name}. Or run 'enliven edge' or 'enliven view' alone.",
            )


def _command_line(program: str, /, **options: Any) -> list[str]:
    """Converts options by name to a command line. None and False are left out, True gives an option without a
    value, and a list repeats the option.
    """
    arguments = [program]
    for option, value in options.items():
        for item in value if isinstance(value, list) else [value]:
            if item is not None and item is not False:
                arguments += [f"--{option.replace('_', '-')}", *([] if item is True else [str(item)])]
    return arguments
