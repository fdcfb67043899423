"""The command ``enliven examples``: moves a mesh by a few example poses, without a window."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from enliven.commands.example_files import Job, export_time_span, find_writer, open_puppet
from enliven.commands.terminal import print_line
from enliven.errors import InputError
from enliven.files import require_folder

if TYPE_CHECKING:
    from enliven.meshes import Axis

examples = typer.Typer(no_args_is_help=True, rich_markup_mode=None)


@examples.callback()
def _examples() -> None:
    """Move a mesh by a few example poses. A session maps a performer's poses to poses of the mesh.

    \b
      enliven examples new CACTUS.off TRAFFIC.bvh -o cactus.toml --height 1.5
      enliven examples check cactus.toml
      enliven examples fit cactus.toml -o cactus.glb --sheet cactus.png
    """


@examples.command()
def new(
    mesh: Annotated[Path, typer.Argument(help="Mesh file: .obj, .off, .ply, .stl, .glb, ...")],
    take: Annotated[
        Path,
        typer.Argument(help="Motion file: .bvh, .mcap, .glb, or a table of the CMU motion database (.txt)."),
    ],
    output: Annotated[Path, typer.Option("--output", "-o", help="Output session file (.toml).")],
    points: Annotated[
        int, typer.Option(min=1, max=100, help="Maximum number of control points at the extremities.")
    ] = 6,
    poses: Annotated[
        int | None,
        typer.Option(min=2, max=100, help="Number of key poses. Default: the number that the motion needs."),
    ] = None,
    height: Annotated[
        float | None, typer.Option(help="Scale the mesh to this height in metres. Default: unchanged.")
    ] = None,
    up: Annotated[str, typer.Option(help="Axis of the mesh that points up: x, y or z.")] = "y",
    turned: Annotated[
        float,
        typer.Option(
            help="Rotation of the upright mesh about the vertical axis in degrees, so that the mesh faces +Z."
        ),
    ] = 0.0,
    animation: Annotated[
        str | None,
        typer.Option(help="Name of an animation in a .glb, or of a person in an .mcap. Default: the first."),
    ] = None,
    start: Annotated[
        float, typer.Option(min=0, help="Start of the used part of the motion, in seconds.")
    ] = 0.0,
    end: Annotated[
        float | None, typer.Option(min=0, help="End of the used part of the motion, in seconds.")
    ] = None,
) -> None:
    """Start a session with guessed control points, joints, symmetry and key poses.

    At first, all key poses show the mesh at rest. In each key pose, set the positions of the control points,
    so that the mesh matches the performer's pose at that time. Do this in the studio or in the file.

    \b
      enliven examples new CACTUS.off TRAFFIC.bvh -o cactus.toml --height 1.5
      enliven examples new TREX.ply WALK.bvh -o trex.toml --up z --turned 90 --poses 4
    """
    require_folder(output)
    from enliven.document import Project
    from enliven.example_sessions.mesh import fit_mesh
    from enliven.example_sessions.tables import MeshTable, TakeTable
    from enliven.example_sessions.text import write_session
    from enliven.meshes import load_mesh
    from enliven.modeling.puppet.suggest import suggest_puppet
    from enliven.motion_clips.take_files import read_take

    mesh_from = MeshTable(_path_from_session(output, mesh), height, _parse_axis(up), turned)
    take_from = TakeTable(_path_from_session(output, take), "", animation, start, end)
    loaded_mesh, notes = load_mesh(mesh)
    clip, more_notes = read_take(take, animation, start, end)
    _print_result(*notes, *more_notes)
    project = Project().with_takes(clip)
    puppet_project = suggest_puppet(
        project, fit_mesh(loaded_mesh, mesh_from), clip.id, mesh.stem, points, poses
    )
    write_session(output, puppet_project, mesh.stem, mesh_from, {clip.id: take_from})
    puppet = puppet_project.puppets[mesh.stem]
    print_line(
        f"enliven: {output} contains {len(puppet.points)} control points and "
        f"{len(puppet.poses)} key poses. Next, set the positions of the control points in each "
        "key pose."
    )


@examples.command()
def check(
    session: Annotated[Path, typer.Argument(help="Session (.toml) or project (.enliven).")],
    puppet: Annotated[
        str | None, typer.Option(help="Name of a puppet in the project. Default: the first.")
    ] = None,
) -> None:
    """Report what is missing in a session, and how well its examples cover the motion.

    The exit code is 3 if something is missing.

    \b
      enliven examples check CACTUS.toml
      enliven examples check SHOW.enliven --puppet cactus
    """
    from enliven.examples.coverage import describe_unposed, measure_coverage
    from enliven.examples.puppet_examples import find_missing_examples
    from enliven.examples.puppet_motion import solve_layer_motion

    source = open_puppet(session, puppet)
    project, character = source.project, source.puppet
    pairs = ", ".join(
        f"{p.name} - {p.joint or 'nothing'}{' (foot)' if p.foot else ''}" for p in character.points
    )
    print_line(f"enliven: {character.id}: {len(character.points)} control points: {pairs or 'none'}")
    pose_list = ", ".join(f"{pose.time:.2f} s of {pose.take}" for pose in character.poses)
    print_line(f"enliven: {len(character.poses)} key poses: {pose_list or 'none'}")
    problems = [*find_missing_examples(project, character), *describe_unposed(character)]
    if not character.layers:
        problems.append("Add a [[layer]] with the motion that the puppet plays.")
    for sentence in problems:
        print_line(f"enliven: {sentence}")
    if find_missing_examples(project, character):
        raise typer.Exit(3)
    for number in range(len(character.layers)):
        print_line(f"enliven: {measure_coverage(project, character, number)}")
        _print_result(*solve_layer_motion(project, character, number).notes)
    if problems:
        raise typer.Exit(3)


@examples.command()
def fit(
    session: Annotated[Path, typer.Argument(help="Session (.toml) or project (.enliven).")],
    output: Annotated[
        Path, typer.Option("--output", "-o", help="Output file: .glb, .enliven, or .mcap (a take).")
    ],
    puppet: Annotated[
        str | None, typer.Option(help="Name of a puppet in the project. Default: the first.")
    ] = None,
    sheet: Annotated[
        Path | None,
        typer.Option(
            help="Draw six frames of the motion and the puppet to this image (needs the viewer's package)."
        ),
    ] = None,
    rate: Annotated[float, typer.Option(min=1, max=240, help="Frames per second of the output.")] = 30.0,
    start: Annotated[float, typer.Option(help="Start of the output, in seconds.")] = 0.0,
    end: Annotated[
        float | None,
        typer.Option(help="End of the output, in seconds. Default: when every layer was played once."),
    ] = None,
    morphs: Annotated[
        bool, typer.Option("--morphs", help="Write morph targets instead of joint transforms (only .glb).")
    ] = False,
) -> None:
    """Move the mesh by its example poses, and write the result to a file.

    \b
      enliven examples fit CACTUS.toml -o cactus.glb
      enliven examples fit CACTUS.toml -o cactus.glb --sheet cactus.png --end 5
      enliven examples fit SHOW.enliven --puppet cactus -o cactus.mcap
      enliven examples fit CACTUS.toml -o cactus.enliven
    """
    from enliven.examples.coverage import describe_unposed
    from enliven.examples.puppet_examples import find_missing_examples
    from enliven.examples.puppet_motion import solve_layer_motion

    write = find_writer(output)
    require_folder(sheet)
    from enliven.exporters import find_sheet_function

    draw = find_sheet_function("puppet") if sheet else None
    source = open_puppet(session, puppet)
    project, character = source.project, source.puppet
    problems = find_missing_examples(project, character)
    if output.suffix.lower() != ".enliven":
        # An unposed character may be written to a project, because it can be posed later in the studio. In
        # other files, it would slide without moving its limbs.
        problems = (*problems, *describe_unposed(character))
    if problems:
        raise InputError("the puppet cannot be moved yet", where=str(session), remedy=" ".join(problems))
    if not any(not layer.muted for layer in character.layers):
        raise InputError(
            "the puppet plays no motion",
            where=str(session),
            remedy="Add a [[layer]] with the motion that the puppet plays.",
        )
    _print_result(*source.notes)
    for number, layer in enumerate(character.layers):
        if not layer.muted:
            _print_result(*solve_layer_motion(project, character, number).notes)
    span = export_time_span(project, character, start, end)
    remark = write(Job(project, character, output, span, rate, morphs))
    if sheet and draw:
        draw(sheet, project, character, span)
    print_line(
        f"enliven: {output} contains {span[1] - span[0]:.2f} s of motion from "
        f"{len(character.poses)} key poses{remark}"
    )


def _path_from_session(session: Path, file: Path) -> str:
    """Returns the path of a file as stored in a session. It is relative to the session's folder if the file
    is near it, and otherwise absolute."""
    home, target = session.resolve().parent, file.resolve()
    return target.relative_to(home).as_posix() if target.is_relative_to(home) else target.as_posix()


def _parse_axis(name: str) -> Axis:
    axes: dict[str, Literal["x", "y", "z"]] = {"x": "x", "y": "y", "z": "z"}
    if name not in axes:
        raise InputError(f"{name!r} is not an axis", where="--up", remedy="Write x, y or z.")
    return axes[name]


def _print_result(*notes: str) -> None:
    for note in notes:
        print_line(f"enliven: {note}", err=True)
