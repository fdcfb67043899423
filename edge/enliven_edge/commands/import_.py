"""``enliven import``: converts recordings of other programs."""

from __future__ import annotations

from itertools import chain, islice
from pathlib import Path
from typing import Annotated

import typer
from rich.table import Table

from enliven.commands.terminal import make_plain_console, make_plain_text, print_line
from enliven.errors import InputError
from enliven_edge.commands.image_options import LensOption, UnitsOption
from enliven_edge.commands.progress import write_recording


def import_recording(
    files: Annotated[
        list[str] | None, typer.Argument(help="Files, folders, or patterns such as 'FRAMES/*.png'.")
    ] = None,
    output: Annotated[Path | None, typer.Option("--output", "-o", help="Output recording.")] = None,
    reader: Annotated[
        str | None, typer.Option(help="Layout of the files, if it is not recognised (see --list-readers).")
    ] = None,
    fps: Annotated[
        float | None,
        typer.Option(min=0.1, max=1000.0, help="Frames per second, if the files contain no times."),
    ] = None,
    device: Annotated[
        str | None,
        typer.Option(help="Sensor to read, if a file contains several. Otherwise, a name for the sensor."),
    ] = None,
    lens: LensOption = None,
    units_per_metre: UnitsOption = None,
    mirror: Annotated[
        bool, typer.Option(help="Swap left and right (some drivers deliver a mirror image).")
    ] = False,
    level: Annotated[
        int, typer.Option(min=1, max=22, help="Compression level: 1 is fast, 19 makes small files.")
    ] = 1,
    overwrite: Annotated[bool, typer.Option(help="Replace an existing recording.")] = False,
    list_readers: Annotated[bool, typer.Option("--list-readers", help="List the known layouts.")] = False,
) -> None:
    """Convert a recording of another program: depth images or skeletons, in any known layout.

    \b
      enliven import PERSON_TURN/ -o turn.mcap                    a folder of depth images
      enliven import GESTURES/WAVE.csv -o wave.mcap               one skeleton recording
      enliven import STUDY.csv --device 10.0.0.7 -o two.mcap      one of several Kinects in a file
      enliven import VIEWER.bag -o viewer.mcap                    RealSense Viewer, Orbbec Viewer (or .db3)
      enliven import "FRAMES/*.u16" --fps 15 -o frames.mcap       images without times
      enliven import rgbd_dataset_freiburg1_desk/ -o desk.mcap    a folder of TUM or 7-Scenes
      enliven import D405/ --units-per-metre 10000 -o d405.mcap   depth images in another unit
      enliven import --list-readers                               list the known layouts
    """
    from enliven_edge.importing.base import ImportOptions, parse_lens
    from enliven_edge.importing.mirror import mirror_frames
    from enliven_edge.importing.registry import find_files, find_reader

    console = make_plain_console()
    if list_readers:
        console.print(_reader_table())
        return
    if not files or output is None:
        raise InputError(
            "no input file is named" if not files else "no output file is named",
            where="enliven import",
            remedy="For example: enliven import FOLDER -o take.mcap",
        )
    paths = find_files(files)
    chosen_reader = find_reader(paths, reader)
    notes = [chosen_reader.note] if chosen_reader.note else []
    options = ImportOptions(fps, device, parse_lens(lens), units_per_metre, notes.append)
    frames = iter(chosen_reader.read(paths, options))
    # Read the first frame in advance. The reader then makes its assumptions about the files, which the
    # recording stores.
    first_frame = list(islice(frames, 1))
    frames = chain(first_frame, frames)
    contents = write_recording(
        mirror_frames(frames) if mirror else frames,
        output,
        task=f"Importing ({chosen_reader.name})",
        facts=("import", {"reader": chosen_reader.name, "note": "; ".join(notes)}),
        empty=InputError(
            "the files contain no frames", where=chosen_reader.name, remedy="Choose other files."
        ),
        level=level,
        overwrite=overwrite,
        console=console,
    )
    size = output.stat().st_size / 1e6
    print_line(f"{output}: {contents.summary} ({chosen_reader.name}, {size:.1f} MB)")
    for note in notes:
        print_line(f"Note: {note}.")


def _reader_table() -> Table:
    from enliven_edge.importing.registry import readers

    table = Table("reader", "layout", "note")
    for reader in readers().values():
        table.add_row(*map(make_plain_text, (reader.name, reader.description, reader.note)))
    return table
