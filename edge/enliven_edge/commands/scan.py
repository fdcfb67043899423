"""``enliven scan``: scans an object with a depth camera that is carried round it, and writes its mesh."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from enliven.errors import InputError
from enliven.files import require_folder, write_picture

if TYPE_CHECKING:
    from enliven.meshes import Mesh

_DEFAULT_VOXEL_MM = 4.0
"""Side of a voxel if none is given, in millimetres. It suits a chair or a lamp."""


def scan(
    output: Annotated[
        Path,
        typer.Option(
            "--output", "-o", help="Output file: a mesh (.glb, .ply, .obj, .stl) or a project (.enliven)."
        ),
    ],
    recording: Annotated[Path | None, typer.Option(help="Recording of a depth camera.")] = None,
    sensor: Annotated[
        str | None, typer.Option(help="Sensor type, if the scan uses a sensor instead of a recording.")
    ] = None,
    setting: Annotated[
        list[str] | None, typer.Option("--set", help="Sensor option, KEY=VALUE. Repeat for several options.")
    ] = None,
    voxel: Annotated[
        float | None,
        typer.Option(min=1, max=50, help="Voxel size in millimetres. By default 4, or 8 for a person."),
    ] = None,
    reach: Annotated[
        float,
        typer.Option(
            min=0.3, max=10, help="Maximum distance from the camera to scanned surfaces, in metres."
        ),
    ] = 2.2,
    within: Annotated[
        float | None,
        typer.Option(
            min=0.3,
            max=10,
            help="Ignore depth beyond this many metres. Use it if the object is turned, not the camera.",
        ),
    ] = None,
    moved: Annotated[
        bool,
        typer.Option(
            help="Use this if you turn the object and put it down during the scan. The mesh shows all sides."
        ),
    ] = False,
    turned: Annotated[
        bool,
        typer.Option(
            help="Use this if the object turns on a turntable. The object is tracked while it moves."
        ),
    ] = False,
    person: Annotated[
        bool,
        typer.Option(help="Scan a person in front of a fixed camera. The person turns once or holds still."),
    ] = False,
    thing: Annotated[
        int,
        typer.Option(
            min=1, help="Object to keep, if several are on the floor. 1 is the object that was most in view."
        ),
    ] = 1,
    seconds: Annotated[
        float | None,
        typer.Option(min=0.0, help="Maximum duration in seconds, measured by the sensor's clock."),
    ] = None,
    memory: Annotated[
        int,
        typer.Option(min=16, help="Maximum memory of the voxels in megabytes. The scan ends at this limit."),
    ] = 1500,
    whole: Annotated[
        bool, typer.Option(help="Keep the whole scan, not only the object on the floor.")
    ] = False,
    box: Annotated[
        str,
        typer.Option(help="Keep only this box: x0,y0,z0,x1,y1,z1 in metres, in the coordinates of --whole."),
    ] = "",
    before: Annotated[
        Path | None,
        typer.Option(
            help="Recording of the place without the object. The scan leaves out the surfaces of this place."
        ),
    ] = None,
    add: Annotated[
        Path | None, typer.Option(help="Earlier scan to extend: its mesh, project or recording.")
    ] = None,
    keep: Annotated[
        bool, typer.Option(help="Save the images in NAME.scan.mcap, so that --add can extend the scan.")
    ] = True,
    triangles: Annotated[
        int, typer.Option(min=0, help="Maximum number of triangles of the mesh. 0 keeps all.")
    ] = 50_000,
    edge: Annotated[
        str | None,
        typer.Option(help="Also put the scan on the stage of this running edge: HOST or HOST:PORT."),
    ] = None,
    sheet: Annotated[
        Path | None, typer.Option(help="Also write six views of the mesh to this PNG file.")
    ] = None,
    overwrite: Annotated[bool, typer.Option(help="Replace an existing mesh.")] = False,
) -> None:
    """Scan an object: carry a depth camera round it until the recording ends, the time is up, or Ctrl-C.

    The object on the floor that the camera looked at is cut out, turned upright and written in metres. While
    camera tracking is lost, nothing is added. To continue, point the camera at a part that was already
    scanned.
    With --within, the camera may stand still while the object or person turns.
    With --moved, scan the object where it stands. Then lay the object on its back or side, and continue.
    With --turned, the object stands for a second, then turns on a turntable. The moving part is detected
    and tracked separately from the room.
    With --person, stand one to three metres in front of a fixed camera, and turn once on the spot.

    \b
      enliven scan --sensor realsense -o chair.glb --sheet chair.png
      enliven scan --sensor realsense -o chair.glb --edge 192.168.1.20
      enliven scan --sensor realsense -o me.enliven --person --seconds 10
      enliven scan --sensor realsense -o chair.glb --moved
      enliven scan --sensor realsense -o vase.glb --turned
      enliven scan --recording TAKE.mcap -o room.glb --whole --voxel 10 --reach 5
      enliven scan --recording TAKE.mcap -o lamp.glb --box=-0.3,0.7,-0.2,0.1,1.3,0.2
      enliven scan --recording WITH.mcap --before EMPTY.mcap -o chair.glb
      enliven scan --recording MORE.mcap --add chair.glb -o chair.glb
    """
    from enliven.scanning.objects.moved_scanner import MovedScanner, object_tracking_settings
    from enliven_edge.commands.scan_job import (
        ScanJob,
        create_scanner,
        parse_box,
        refuse_combination,
        select_kept_part,
    )
    from enliven_edge.scanning.person import MAX_PERSON_DISTANCE_M, PERSON_VOXEL_M, PersonScanner
    from enliven_edge.scanning.scan_mesh import put_on_stage, stage_command

    require_folder(output, sheet)
    _check_arguments(output, recording, sensor, overwrite or output == add)
    kept_part = select_kept_part(whole, parse_box(box), before, within)
    if before is not None and add is not None:
        raise InputError(
            "--before and --add cannot be used together", where="scan", remedy="Leave one of them out."
        )
    if edge is not None:
        stage_command()  # Report missing requirements of the stage before the scan, not after it.
    voxel = voxel or (1e3 * PERSON_VOXEL_M if person else _DEFAULT_VOXEL_MM)
    scanner = create_scanner(voxel, reach, within, memory, thing)
    if moved or turned:
        refuse_combination("--turned" if turned else "--moved", whole, box, before, add, within)
        scanner = MovedScanner(object_tracking_settings(scanner.settings) if turned else scanner.settings)
    if person:
        refuse_combination("--person", whole, box, before, add, within)
        if moved or turned:
            other = "--turned" if turned else "--moved"
            raise InputError(
                f"--person and {other} cannot be used together", where="scan", remedy="Leave one of them out."
            )
        scanner = PersonScanner(
            create_scanner(voxel, MAX_PERSON_DISTANCE_M, MAX_PERSON_DISTANCE_M, memory).settings
        )
    job = ScanJob(scanner, recording, sensor or "", setting or [], seconds, before or add, keep)
    scan_result = job.run(kept_part, triangles, output)
    if sheet is not None:
        _write_sheet(scan_result.mesh, sheet)
    job.print_result(scan_result, output)
    if edge is not None:
        put_on_stage(output, edge)


def _check_arguments(output: Path, recording: Path | None, sensor: str | None, overwrite: bool) -> None:
    """Raises InputError for invalid arguments, before the first frame is read."""
    from enliven_edge.scanning.scan_mesh import OUTPUT_SUFFIXES

    if (recording is None) == (sensor is None):
        raise InputError(
            "a scan needs either a recording or a sensor", where="scan", remedy="Use --recording or --sensor."
        )
    if output.suffix.lower() not in OUTPUT_SUFFIXES:
        endings = ", ".join(ending[1:] for ending in OUTPUT_SUFFIXES)
        raise InputError(
            f"cannot write files with the extension {output.suffix!r}",
            where=str(output),
            remedy=f"Known extensions: {endings}.",
        )
    if output.exists() and not overwrite:
        raise InputError(
            "the file exists already", where=str(output), remedy="Add --overwrite to replace it."
        )


def _write_sheet(mesh: Mesh, path: Path) -> None:
    from PIL import Image

    from enliven_edge.scanning.contact_sheet import draw_contact_sheet

    write_picture(path, Image.fromarray(draw_contact_sheet(mesh)))
