"""``enliven replay``: sends a recording through the edge at its recorded pace, like a live sensor."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from enliven_edge.commands.edge import edge


def replay(
    recording: Annotated[Path, typer.Argument(help="Recording to replay.")],
    speed: Annotated[
        float, typer.Option(min=0.0, help="Speed: 1 is the recorded speed, 2 is twice as fast.")
    ] = 1.0,
    fast: Annotated[bool, typer.Option("--fast", help="Replay as fast as possible.")] = False,
    loop: Annotated[bool, typer.Option(help="Restart the replay at its end.")] = False,
    mesh: Annotated[str, typer.Option(help="Mesh to possess: a file, 'chair' or 'lamp'.")] = "chair",
    possess_at: Annotated[
        float, typer.Option(help="Time in seconds after the start at which the mesh is possessed.")
    ] = 1.5,
    parts: Annotated[
        str, typer.Option(help="Body parts that possess the mesh, such as all, legs or 'upper body'.")
    ] = "all",
    record: Annotated[
        Path | None, typer.Option(help="Write the take (bodies and poses) to this file.")
    ] = None,
    overwrite: Annotated[bool, typer.Option(help="Replace an existing take.")] = False,
    out: Annotated[
        list[str] | None,
        typer.Option(help="Send the motion live to another program, as enliven edge --out does."),
    ] = None,
    port: Annotated[int | None, typer.Option(help="Network port of the poses. 0 picks a free port.")] = None,
    control_port: Annotated[int | None, typer.Option(help="Network port of the commands.")] = None,
) -> None:
    """Replay a recording through the edge: track people, possess a mesh, and publish the poses.

    \b
      enliven replay TAKE.mcap
      enliven replay TAKE.mcap --speed 0.5 --loop
      enliven replay TAKE.mcap --out vmc:127.0.0.1 --out rokoko:127.0.0.1
      enliven replay TAKE.mcap --fast --record performance.mcap
    """
    edge(
        recording=[str(recording)],
        speed=0.0 if fast else speed,
        loop=loop,
        mesh=[mesh],
        possess_at=possess_at,
        parts=[parts],
        record=record,
        overwrite=overwrite,
        out=out,
        port=port,
        control_port=control_port,
    )
