"""The command ``enliven possess``: lets the performers of a recording move another mesh."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from enliven.commands.terminal import print_line
from enliven.errors import InputError

if TYPE_CHECKING:
    from enliven.meshes import Axis, Mesh


def possess(
    take: Annotated[Path, typer.Argument(help="Recording (.mcap) of an edge, or of tracked people.")],
    output: Annotated[Path, typer.Option("--output", "-o", help="Output file: .enliven, .glb or .mp4.")],
    mesh: Annotated[
        str,
        typer.Option(help="Mesh file, chair or lamp. Default: the mesh that was possessed in the recording."),
    ] = "",
    character: Annotated[
        str,
        typer.Option(
            "--character",
            "-c",
            help="Character of the recording. Default: the first character that was possessed.",
        ),
    ] = "",
    parts: Annotated[
        str, typer.Option(help="Body parts that possess the mesh. Default: the body parts in the recording.")
    ] = "",
    at: Annotated[
        float,
        typer.Option(min=0, help="With --parts: time in seconds at which the body parts possess the mesh."),
    ] = 0.0,
    nodes: Annotated[
        int, typer.Option(min=1, max=4096, help="Number of nodes in the deformation graph of the mesh.")
    ] = 128,
    up: Annotated[
        Literal["x", "y", "z"] | None,
        typer.Option(help="Axis of the mesh that points up. Default: guessed."),
    ] = None,
) -> None:
    """Move a mesh by the performers of a recording, as if the performers had possessed the mesh.

    The recording of an edge contains which performer possessed the mesh, the body parts, and the settings. If
    this information is missing, the first performer possesses the mesh with the whole body.

    \b
      enliven possess TAKE.mcap --mesh HORSE.obj -o horse.glb
      enliven possess TAKE.mcap --mesh lamp --parts "hip + right arm" -o lamp.enliven
    """
    # Import large modules only here, so that `--help` is fast.
    from dataclasses import replace

    from enliven.document import HoldChange, Project
    from enliven.exporters import exporter_of, sample_performance
    from enliven.formats.project.file import write_project
    from enliven.modeling.possessed.another_mesh import possess_another
    from enliven.modeling.possessed.solving import solve_again, with_possession
    from enliven.motion_clips.recorded_characters import read_possession

    exporter = None if output.suffix.lower() == ".enliven" else exporter_of(output)
    source, name, bodies, possessions = read_possession(take, character)
    notes = list[str]()
    if parts:
        possessions = replace(possessions, holds=(HoldChange(at, parts=parts),))
    if mesh:
        model, fit = _read_mesh(mesh, up)
        project, name = possess_another(
            Project(), model, bodies, possessions, fit=fit, nodes=nodes, notes=notes
        )
    elif name:
        project = solve_again(with_possession(source, name, possessions), name, notes=notes)
    else:
        remedy = "Choose a mesh, such as --mesh chair."
        raise InputError("no mesh was possessed in this recording", where=str(take), remedy=remedy)
    for note in notes:
        print_line(f"enliven: {note}", err=True)
    if exporter is None:
        write_project(output, project)
    else:
        exporter.save(output, [sample_performance(project, name)], take.stem)
    print_line(f"enliven: {output} contains {project.end_of(project.graph(name)):.2f} s of motion of {name}")


def _read_mesh(spec: str, up: Axis | None) -> tuple[Mesh, bool]:
    """Returns a mesh, and True if it must be scaled to a person's size. The meshes that enliven contains
    already have this size.

    Raises:
        InputError: if the mesh cannot be read.
    """
    from enliven.meshes import load_upright
    from enliven.samples.shipped import load_sample

    if spec in ("chair", "lamp"):
        return load_sample(spec), False
    mesh, notes = load_upright(spec, up)
    for note in notes:
        print_line(f"enliven: {spec}: {note}", err=True)
    return mesh, True
