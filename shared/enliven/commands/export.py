"""The command ``enliven export``: writes the motion of a recording, a project or a motion file for other
programs."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from enliven.commands.terminal import print_line, progress_lines
from enliven.errors import InputError
from enliven.exporters import IN_PLACE, SCALE, UNIT, UP

if TYPE_CHECKING:
    from enliven.exporters import Exporter, Performance
    from enliven.oneshot.exportable import Exportable


def export(
    source: Annotated[
        Path,
        typer.Argument(help="Recording (.mcap), project (.enliven), or motion file (.bvh, .txt or .glb)."),
    ],
    output: Annotated[
        Path,
        typer.Option(
            "--output",
            "-o",
            help="Output: .glb, .bvh, .usdz, .vrma, .vrm, .csv, .html, .mcap, .mp4, or folder .obj-sequence.",
        ),
    ],
    character: Annotated[
        list[str] | None,
        typer.Option(
            "--character", "-c", help="Export only this character, person or animation. Can be repeated."
        ),
    ] = None,
    start: Annotated[float, typer.Option(min=0, help="Start of the exported part, in seconds.")] = 0.0,
    end: Annotated[
        float | None,
        typer.Option(min=0, help="End of the exported part, in seconds. Default: the end of the motion."),
    ] = None,
    rate: Annotated[
        float | None,
        typer.Option(
            min=1, max=240, help="Frames per second of the output. Default: the rate of the recording, or 30."
        ),
    ] = None,
    unit: Annotated[
        str | None,
        typer.Option(help=f"{UNIT.help} One of {', '.join(UNIT.choices)}. Default: {UNIT.default}."),
    ] = None,
    scale: Annotated[float | None, typer.Option(help=f"{SCALE.help} Default: {SCALE.default:g}.")] = None,
    up: Annotated[
        Literal["y", "z"] | None,
        typer.Option(help=f"{UP.help} Default: {UP.default}."),
    ] = None,
    in_place: Annotated[bool, typer.Option("--in-place", help=IN_PLACE.help)] = False,
    size: Annotated[
        str | None, typer.Option(help="Image size of an .mp4 in pixels, such as 1920x1080.")
    ] = None,
    morphs: Annotated[
        bool,
        typer.Option(
            "--morphs", help="Write puppets as morph targets instead of joint transforms (only .glb)."
        ),
    ] = False,
) -> None:
    """Write the motion of a recording or a project to a file for other programs, such as .glb, .bvh or .mp4.

    Characters are written with their surface and transforms. If a recording has no characters, its people are
    written as stick figures. A .bvh contains one skeleton: of a person, a rigged model, or a motion file. A
    .usda, .usdc or .usdz contains skeletons, and the vertex positions of characters without a skeleton. A
    .vrma contains the motion of one humanoid, and a .vrm contains the model of one humanoid. A .csv is a
    table of positions and rotations. An .obj-sequence is a folder with one .obj per frame. An .html is a web
    page that plays offline. An .mcap is a recording, which enliven view plays.

    \b
      enliven export TAKE.mcap -o take.glb                 the performance, for any program
      enliven export TAKE.mcap -o body.bvh --start 2 --end 8
      enliven export SHOW.enliven -o horse.bvh --character horse --unit cm
      enliven export SHOW.enliven -o walk.csv --in-place --up z
      enliven export TAKE.mcap -o part.mcap --start 2 --end 8
      enliven export SHOW.enliven -o show.mp4 --size 1920x1080
    """
    # Import large modules only here, so that `--help` is fast.
    from enliven.exporters import exporter_of

    all_options = {
        "unit": unit,
        "size": size,
        "morphs": morphs or None,
        "scale": scale,
        "up": up,
        "in_place": in_place or None,
    }
    options = {name: value for name, value in all_options.items() if value is not None}
    exporter = exporter_of(output, (), **options)
    if output.exists() and output.samefile(source):
        raise InputError(
            "the output file is also the source file", where=str(output), remedy="Choose another output file."
        )
    from enliven.oneshot.exportable import find_exportables
    from enliven.sounds import mix_from

    exportables, notes, sounds = find_exportables(source)
    for note in notes:
        print_line(f"enliven: {note}", err=True)
    performances, representation = [], exporter.representation(morphs)
    for exportable in _find_chosen_characters(exportables, exporter, character or [], source):
        print_line(f"enliven: sampling {exportable.name}", err=True)
        performances.append(exportable.sample(start, end, rate, representation, exporter.keyed))
    sound_options = {"sound": mix_from(sounds, start)} if exporter.heard and sounds else {}
    _write_with_progress(exporter, output, performances, source.stem, options | sound_options)
    duration_s = max(performance.times[-1] for performance in performances)
    names = ", ".join(performance.name for performance in performances)
    baked = "".join(
        f"; {performance.name} is {performance.error}"
        for performance in performances
        if performance.error is not None
    )
    print_line(f"enliven: {output} contains {duration_s:.2f} s of motion of {names}{baked}")


def _write_with_progress(
    exporter: Exporter, output: Path, performances: list[Performance], title: str, options: dict[str, Any]
) -> None:
    """Writes the output file, and shows a progress bar if the exporter reports its progress."""
    if "progress" not in exporter.options:
        exporter.save(output, performances, title, **options)
        return
    with progress_lines("{task.description}", "{task.percentage:>3.0f} %", bar=True) as display:
        task = display.add_task(f"writing {output.name}", total=1.0)

        def show(fraction: float) -> None:
            display.update(task, completed=fraction)

        exporter.save(output, performances, title, progress=show, **options)


def _find_chosen_characters(
    exportables: list[Exportable], exporter: Exporter, names: list[str], source: Path
) -> list[Exportable]:
    """Returns the characters with the given names. Without names, returns all characters that the file format
    supports.

    Raises:
        InputError: if a name does not exist, or if the file format supports none of the characters, or only a
            single character.
    """
    by_name = {exportable.name: exportable for exportable in exportables}
    for name in names:
        if name not in by_name:
            remedy = f"Known characters: {', '.join(by_name)}."
            raise InputError(f"the source has no character {name!r}", where=str(source), remedy=remedy)
    missing_parts = {
        exportable.name: _describe_missing_part(exportable, exporter) for exportable in exportables
    }
    fitting = [exportable for exportable in exportables if not missing_parts[exportable.name]]
    unsuitable = [name for name in names or by_name if missing_parts[name]]
    if unsuitable and (names or not fitting):
        lack = missing_parts[unsuitable[0]]
        remedy = (
            "Write a .glb file instead, which can contain any surface."
            if lack == "skeleton"
            else "Write a .bvh file instead."
        )
        raise InputError(
            f"{', '.join(unsuitable)} has no {lack}, but the output format needs one",
            where=str(source),
            remedy=remedy,
        )
    best = min(exportable.rank for exportable in fitting)
    chosen_characters = [by_name[name] for name in names] or [
        exportable for exportable in fitting if exportable.rank == best
    ]
    if exporter.single and len(chosen_characters) > 1:
        remedy = (
            f"Choose one with --character: {', '.join(exportable.name for exportable in chosen_characters)}."
        )
        raise InputError("the output format can contain only one character", where=str(source), remedy=remedy)
    return chosen_characters


def _describe_missing_part(exportable: Exportable, exporter: Exporter) -> str:
    """Returns the missing part of a character that the exporter requires: "skeleton", "surface", or an empty
    string.
    """
    if exporter.jointed and not exportable.jointed:
        return "skeleton"
    return "surface" if exporter.solid and not exportable.solid else ""
