"""enliven possess: a mesh moved by the performers of a recording, who held another one, or none."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from enliven.errors import InputError

if TYPE_CHECKING:
    from enliven.meshes import Axis, Mesh
    from enliven.possession import ActorSettings


def possess(
    take: Annotated[Path, typer.Argument(help="A recording (.mcap) of an edge, or of tracked people.")],
    output: Annotated[Path, typer.Option("--output", "-o", help="What to make: .enliven, .glb or .mp4.")],
    mesh: Annotated[
        str, typer.Option(help="A mesh file, or chair or lamp; else the mesh that was possessed.")
    ] = "",
    character: Annotated[
        str, typer.Option("--character", "-c", help="Of the recording; else the first that was possessed.")
    ] = "",
    parts: Annotated[
        str, typer.Option(help="Parts of the body that take hold, in place of what was recorded.")
    ] = "",
    at: Annotated[float, typer.Option(min=0, help="Seconds at which they do, with --parts.")] = 0.0,
    nodes: Annotated[int, typer.Option(min=1, max=4096, help="Nodes of the other mesh's graph.")] = 128,
    up: Annotated[
        Literal["x", "y", "z"] | None,
        typer.Option(help="The mesh file's own axis that points up; else guessed."),
    ] = None,
) -> None:
    """Move a mesh by the performers of a recording, as if they had stepped into it.

    Who took hold, with what and how, is read from the recording of an edge. Where it does not say, the first
    performer takes hold with all of the body.

    \b
      enliven possess TAKE.mcap --mesh HORSE.obj -o horse.glb
      enliven possess TAKE.mcap --mesh lamp --parts "hip + right arm" -o lamp.enliven
    """
    # Heavy modules are imported only here, so that the help is quick.
    from dataclasses import replace

    from enliven.document import HoldChange, Project
    from enliven.exporters import exporter_of, performance_of
    from enliven.formats.project import write_project
    from enliven.modeling.possessed import possess_mesh, solve_again, with_possession
    from enliven.possession import settings_of
    from enliven.takes import possession_in

    exporter = None if output.suffix.lower() == ".enliven" else exporter_of(output)
    source, name, bodies, how = possession_in(take, character)
    notes = list[str]()
    if parts:
        how = replace(how, holds=(HoldChange(at, parts=parts),))
    if mesh:
        model, size = _mesh(mesh, settings_of(how), up)
        how = replace(how, place=(), height=0.0, size=size)
        project, name = possess_mesh(Project(), model, bodies, how, nodes=nodes, notes=notes)
    elif name:
        project = solve_again(with_possession(source, name, how), name, notes=notes)
    else:
        mend = "Name one: --mesh chair."
        raise InputError("no mesh was possessed in it", where=str(take), mend=mend)
    for note in notes:
        typer.echo(f"enliven: {note}", err=True)
    if exporter is None:
        write_project(output, project)
    else:
        exporter.write(output, [performance_of(project, name)], take.stem)
    typer.echo(f"enliven: {name}, {project.end_of(project.graph(name)):.2f} s, is in {output}")


def _mesh(spec: str, settings: ActorSettings, up: Axis | None) -> tuple[Mesh, float]:
    """Returns a mesh as it goes on stage, and the metres as modelled for one of it.

    Raises:
        InputError: where it cannot be read.
    """
    from enliven.meshes import load_upright
    from enliven.possession import prepared
    from enliven.samples import load_sample

    if spec in ("chair", "lamp"):
        return load_sample(spec), 1.0
    mesh, notes = load_upright(spec, up)
    for note in notes:
        typer.echo(f"enliven: {spec}: {note}", err=True)
    return prepared(mesh, settings)
