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
    take: Annotated[Path, typer.Argument(help="A recording (.mcap) of an edge, or of tracked people.")],
    output: Annotated[Path, typer.Option("--output", "-o", help="Output file: .enliven, .glb or .mp4.")],
    mesh: Annotated[
        str, typer.Option(help="A mesh file, chair or lamp; by default the mesh that was possessed.")
    ] = "",
    character: Annotated[
        str,
        typer.Option(
            "--character", "-c", help="Character of the recording; by default the first that was possessed."
        ),
    ] = "",
    parts: Annotated[
        str, typer.Option(help="Body parts that possess the mesh, instead of the recorded ones.")
    ] = "",
    at: Annotated[float, typer.Option(min=0, help="Time in seconds at which they do, with --parts.")] = 0.0,
    nodes: Annotated[
        int, typer.Option(min=1, max=4096, help="Number of nodes of the mesh's deformation graph.")
    ] = 128,
    up: Annotated[
        Literal["x", "y", "z"] | None,
        typer.Option(help="The mesh's axis that points up; guessed by default."),
    ] = None,
) -> None:
    """Move a mesh by the performers of a recording, as if they had stepped into it.

    The recording of an edge says which performer possessed the mesh, with which body parts, and how. If it
    does not, the first performer possesses the mesh with the whole body.

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
        remedy = "Name one: --mesh chair."
        raise InputError("no mesh was possessed in it", where=str(take), remedy=remedy)
    for note in notes:
        print_line(f"enliven: {note}", err=True)
    if exporter is None:
        write_project(output, project)
    else:
        exporter.save(output, [sample_performance(project, name)], take.stem)
    print_line(f"enliven: {name}, {project.end_of(project.graph(name)):.2f} s, is in {output}")


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
