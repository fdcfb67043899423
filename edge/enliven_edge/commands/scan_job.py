"""The scan of ``enliven scan``: fuses depth images until they end, and writes the selected surface."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from threading import Event

import numpy as np

from enliven.arrays import Float
from enliven.commands.terminal import make_plain_console, print_line
from enliven.errors import InputError, ResourceError
from enliven.frames import DepthFrame
from enliven.scanning import (
    CutOutSettings,
    Scanner,
    ScanSettings,
    ScanState,
    ScanStep,
    VolumeSettings,
    settings_within,
)
from enliven.scanning.objects.moved_scanner import MovedScanner
from enliven_edge.commands.progress import frame_progress, interruptible
from enliven_edge.scanning.kept_scans import (
    check_registered,
    find_stored_scan_path,
    load_first_part,
    store_scan,
)
from enliven_edge.scanning.object_messages import describe_objects
from enliven_edge.scanning.scan_log import ScanLog
from enliven_edge.scanning.scan_mesh import KeptPart, ScannedMesh, finish_scan, write_scan
from enliven_edge.scanning.sources import read_recorded_images, sensor_images


def create_scanner(voxel: float, reach: float, within: float | None, memory: int, thing: int = 1) -> Scanner:
    """Returns a scanner.

    Args:
        voxel: side of a voxel in millimetres.
        reach: maximum distance of surfaces from the camera, in metres.
        within: distance in metres beyond which depth is ignored; None for no limit.
        memory: limit in megabytes, for the finest voxels and for each coarser level.
        thing: number of the object on the floor to keep. Number 1 is the object that the camera looked at
            most.
    """
    volume = VolumeSettings(voxel=voxel * 1e-3, reach=reach, memory=memory)
    if within is None:
        return Scanner(ScanSettings(volume=volume, cut_out=CutOutSettings(number=thing)))
    return Scanner(settings_within(volume, within))


def parse_box(box: str) -> tuple[Float, Float] | None:
    """Parses a box of six numbers in metres. Returns its two corners (3,), or None for an empty text.

    Raises:
        InputError: if the text is not a box.
    """
    if not box:
        return None
    remedy = "Pass the low and the high corner in metres, such as --box=-0.5,0,-0.5,0.5,1.2,0.5."
    try:
        numbers = np.array([float(part) for part in box.split(",")])
    except ValueError:
        raise InputError(f"{box!r} is not a box x0,y0,z0,x1,y1,z1", where="--box", remedy=remedy) from None
    if len(numbers) != 6 or not np.isfinite(numbers).all() or (numbers[:3] >= numbers[3:]).any():
        raise InputError(f"{box!r} is not a box x0,y0,z0,x1,y1,z1", where="--box", remedy=remedy)
    return numbers[:3], numbers[3:]


def select_kept_part(
    keeps_all: bool, corners: tuple[Float, Float] | None, empty_recording: Path | None, within: float | None
) -> KeptPart:
    """Returns the part of a scan to keep, as chosen by the options.

    Raises:
        InputError: if the options contradict each other.
    """
    options = [
        name
        for name, is_given in (("--whole", keeps_all), ("--box", corners), ("--before", empty_recording))
        if is_given
    ]
    if len(options) > 1:
        problem = f"{' and '.join(options)} cannot be used together"
        raise InputError(problem, where="scan", remedy="Use only one of them.")
    if corners is not None:
        return KeptPart("box", *corners)
    if empty_recording is not None:
        return KeptPart("new")
    return KeptPart("all" if keeps_all else "thing" if within is None else "alone")


def refuse_combination(
    name: str, keeps_all: bool, box: str, empty_recording: Path | None, add: Path | None, within: float | None
) -> None:
    """Raises InputError if an option is given that cannot be combined with ``name``: --moved, --turned or
    --person.

    Raises:
        InputError: if one of these options is given.
    """
    options = (
        ("--whole", keeps_all),
        ("--box", box),
        ("--before", empty_recording),
        ("--add", add),
        ("--within", within),
    )
    for other, is_given in options:
        if is_given:
            remedy = "Leave one of them out."
            raise InputError(f"{name} and {other} cannot be used together", where="scan", remedy=remedy)


@dataclass
class ScanJob:
    """One scan of a command.

    Attributes:
        scanner: fuses the images.
        recording: source of the images. If None, they come from ``sensor`` with its ``options``.
        seconds: maximum duration by the sensor's clock; None for no limit.
        first: an earlier scan or recording to which the images are added, or None.
        keeps_images: whether the images are stored next to the mesh.
    """

    scanner: Scanner | MovedScanner
    recording: Path | None
    sensor: str
    options: list[str]
    seconds: float | None
    first: Path | None
    keeps_images: bool

    def __post_init__(self) -> None:
        self.scan_log, self._notes = ScanLog(), list[str]()

    @property
    def _where(self) -> str:
        return str(self.recording or self.sensor)

    def run(self, keep: KeptPart, triangles: int, output: Path) -> ScannedMesh:
        """Runs the scan, and writes the kept part of the surface as a mesh.

        Raises:
            InputError: if no mesh can be made. The images of a live sensor are then stored.
            ResourceError: if the mesh cannot be written to ``output``. The message names the file to which it
                was written instead.
        """
        earlier_count = self._scan()
        try:
            self.scan_log.raise_scan_error(self._where, self.scanner)
            kept_part = replace(keep, first_object_image=earlier_count) if keep.what == "new" else keep
            scan_result = finish_scan(self.scanner, kept_part, triangles, output.stem)
            self._notes += describe_objects(self.scanner) if keep.what == "thing" else []
        except InputError as error:
            if self.recording is not None or not self._keep_images(output, 0):
                raise
            hint = (
                f"The images were saved. To scan them again, use --recording {find_stored_scan_path(output)}."
            )
            raise InputError(error.what, where=error.where, remedy=f"{error.remedy} {hint}") from None
        if self.keeps_images:
            self._keep_images(output, earlier_count if keep.what == "new" else 0)
        write_scan(scan_result, output)
        return scan_result

    def print_result(self, scan_result: ScannedMesh, output: Path) -> None:
        """Prints a summary of the result, and advice for a better scan."""
        low, high = scan_result.mesh.bounds
        size = " x ".join(f"{100 * side:.0f}" for side in high - low)
        reduction_note = (
            f" (at most {1e3 * scan_result.max_distance:.1f} mm from the full scan)"
            if scan_result.max_distance
            else ""
        )
        summary = f"{len(scan_result.mesh.faces)} triangles{reduction_note}, {size} cm, "
        summary += f"from {self.scan_log.frames} frames"
        print_line(f"{output}: {summary}, {self.scan_log.progress_text(self.scanner)}")
        if scan_result.cut_note:
            print_line(scan_result.cut_note[:1].upper() + scan_result.cut_note[1:])
        if scan_result.mesh.colours is None:
            self._notes.append("The camera sent no colours, so the mesh has no colours.")
        for sentence in (*self.scan_log.advice(self.scanner), *self._notes):
            print_line(f"Note: {sentence}")

    def _scan(self) -> int:
        """Fuses all images. Returns the number of images that come from an earlier scan."""
        with interruptible() as stop, frame_progress(make_plain_console()) as progress:
            task, earlier_count = progress.add_task("Scanning", total=None, count=0), 0
            if self.first is not None and isinstance(self.scanner, Scanner):
                earlier_count = load_first_part(self.scanner, self.first, stop)
            for frame in itertools.takewhile(self._start_time_limit(), self._images(stop)):
                step = self.scanner.add(frame)
                self.scan_log.add(step if isinstance(step, ScanStep) else step.scan_step, frame.time_ns)
                description = f"Scanning, {self.scan_log.progress_text(self.scanner)}"
                progress.update(task, count=self.scan_log.frames, description=description)
                if self.scanner.is_full:
                    break
        if self.first is not None:
            check_registered(self.scan_log.counts[ScanState.SCANNING], self.first)
        return earlier_count

    def _images(self, stop: Event) -> Iterator[DepthFrame]:
        if self.recording is not None:
            return read_recorded_images(self.recording, stop)
        return sensor_images(self.sensor, self.options, stop)

    def _start_time_limit(self) -> Callable[[DepthFrame], bool]:
        """Returns a predicate for images. It is True until the time limit, counted from the first image, is
        reached.
        """
        times_ns: list[int] = []

        def is_in_time(frame: DepthFrame) -> bool:
            times_ns.append(frame.time_ns)
            return self.seconds is None or frame.time_ns - times_ns[0] < self.seconds * 1e9

        return is_in_time

    def _keep_images(self, output: Path, since: int) -> bool:
        """Stores the images next to the mesh. Returns True if images were stored."""
        try:
            store_scan(self.scanner, find_stored_scan_path(output), since)
        except ResourceError as error:
            self._notes.append(f"The images were not saved, so --add cannot extend this scan ({error.what}).")
            return False
        return bool(self.scanner.poses)
