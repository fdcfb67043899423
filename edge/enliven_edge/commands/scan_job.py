"""The work of ``enliven scan``: images are fused until they end, and what is meant becomes a file."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from threading import Event

import numpy as np

from enliven.arrays import Float
from enliven.commands import plain_console, say
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
from enliven.scanning.objects import MovedScanner
from enliven_edge.commands.progress import frame_progress, interruptible
from enliven_edge.scanning import (
    Keep,
    ScanLog,
    ScannedMesh,
    finished,
    keep_scan,
    kept_beside,
    recorded_images,
    refuse_unseen,
    said_of_things,
    scan_first,
    sensor_images,
    write_scan,
)


def scanner_of(voxel: float, reach: float, within: float | None, memory: int, thing: int = 1) -> Scanner:
    """Returns a scanner.

    Args:
        voxel: millimetres of a voxel's side.
        reach: metres up to which surfaces are kept.
        within: metres beyond which all is left out, or None.
        memory: megabytes of the finest voxels, and of each coarser kind of them.
        thing: number of the thing on the floor that is meant, 1 for the one that is looked at most.
    """
    volume = VolumeSettings(voxel=voxel * 1e-3, reach=reach, memory=memory)
    if within is None:
        return Scanner(ScanSettings(volume=volume, cut_out=CutOutSettings(number=thing)))
    return Scanner(settings_within(volume, within))


def corners_of(box: str) -> tuple[Float, Float] | None:
    """Returns the two corners (3,) of a box of six numbers with commas, metres; None for no word.

    Raises:
        InputError: where it is no box.
    """
    if not box:
        return None
    mend = "Give x0,y0,z0,x1,y1,z1 in metres, such as --box=-0.5,0,-0.5,0.5,1.2,0.5."
    try:
        numbers = np.array([float(part) for part in box.split(",")])
    except ValueError:
        raise InputError(f"{box!r} is not a box", where="--box", mend=mend) from None
    if len(numbers) != 6 or not np.isfinite(numbers).all() or (numbers[:3] >= numbers[3:]).any():
        raise InputError(f"{box!r} is not a box", where="--box", mend=mend)
    return numbers[:3], numbers[3:]


def keep_of(
    whole: bool, corners: tuple[Float, Float] | None, before: Path | None, within: float | None
) -> Keep:
    """Returns what is kept of a scan by its options.

    Raises:
        InputError: where they do not go together.
    """
    options = [name for name, on in (("--whole", whole), ("--box", corners), ("--before", before)) if on]
    if len(options) > 1:
        problem = f"{' and '.join(options)} say both what is kept"
        raise InputError(problem, where="scan", mend="Give one of them.")
    if corners is not None:
        return Keep("box", *corners)
    if before is not None:
        return Keep("new")
    return Keep("all" if whole else "thing" if within is None else "alone")


def refuse_beside(
    name: str, whole: bool, box: str, before: Path | None, add: Path | None, within: float | None
) -> None:
    """Refuses what does not go together with ``name``, --moved or --person.

    Raises:
        InputError: where something of it is asked for.
    """
    options = ("--whole", whole), ("--box", box), ("--before", before), ("--add", add), ("--within", within)
    for other, given in options:
        if given:
            mend = "Leave one of them out."
            raise InputError(f"{name} and {other} do not go together", where="scan", mend=mend)


@dataclass
class ScanJob:
    """One scan of a command.

    Attributes:
        scanner: what fuses the images.
        recording: where they come from; or else ``sensor`` and its ``options``.
        seconds: of the sensor's clock after which it stops.
        first: an earlier scan, or a recording, to which the images are added, or None.
        keeps: whether the images are kept beside what is made.
    """

    scanner: Scanner | MovedScanner
    recording: Path | None
    sensor: str
    options: list[str]
    seconds: float | None
    first: Path | None
    keeps: bool

    def __post_init__(self) -> None:
        self.scan_log, self._notes = ScanLog(), list[str]()

    @property
    def _where(self) -> str:
        return str(self.recording or self.sensor)

    def run(self, keep: Keep, triangles: int, output: Path) -> ScannedMesh:
        """Scans, and writes what is kept of it.

        Raises:
            InputError: where there is nothing to make a mesh of; what a sensor saw is kept as images.
            ResourceError: where the mesh cannot be written; it says where it is instead.
        """
        before = self._scan()
        try:
            self.scan_log.refuse(self._where, self.scanner)
            meant = replace(keep, before=before) if keep.what == "new" else keep
            scan_result = finished(self.scanner, meant, triangles, output.stem)
            self._notes += said_of_things(self.scanner) if keep.what == "thing" else []
        except InputError as error:
            if self.recording is not None or not self._kept(output, 0):
                raise
            hint = f"The recorded images were kept: --recording {kept_beside(output)} scans them again."
            raise InputError(error.what, where=error.where, mend=f"{error.mend} {hint}") from None
        if self.keeps:
            self._kept(output, before if keep.what == "new" else 0)
        write_scan(scan_result, output)
        return scan_result

    def tell(self, made: ScannedMesh, output: Path) -> None:
        """Prints what came of it, and what would make it better."""
        low, high = made.mesh.bounds
        size = " x ".join(f"{100 * side:.0f}" for side in high - low)
        few = f" (within {1e3 * made.most:.1f} mm of the full scan)" if made.most else ""
        summary = f"{len(made.mesh.faces)} triangles{few}, {size} cm, of {self.scan_log.frames} frames"
        say(f"{output}: {summary}, {self.scan_log.now}")
        if made.said:
            say(made.said[:1].upper() + made.said[1:])
        if made.mesh.colours is None:
            self._notes.append("The camera gave no colours, so the mesh has none.")
        for sentence in (*self.scan_log.advice(self.scanner), *self._notes):
            say(f"Note: {sentence}")

    def _scan(self) -> int:
        """Fuses all images; returns how many of an earlier scan come before them."""
        with interruptible() as stop, frame_progress(plain_console()) as progress:
            task, before = progress.add_task("Scanning", total=None, count=0), 0
            if self.first is not None and isinstance(self.scanner, Scanner):
                before = scan_first(self.scanner, self.first, stop)
            for frame in itertools.takewhile(self._in_time(), self._images(stop)):
                step = self.scanner.add(frame)
                self.scan_log.add(step if isinstance(step, ScanStep) else step.scan_step, frame.time_ns)
                progress.update(
                    task, count=self.scan_log.frames, description=f"Scanning, {self.scan_log.now}"
                )
                if self.scanner.full:
                    break
        if self.first is not None:
            refuse_unseen(self.scan_log.counts[ScanState.SCANNING], self.first)
        return before

    def _images(self, stop: Event) -> Iterator[DepthFrame]:
        if self.recording is not None:
            return recorded_images(self.recording, stop)
        return sensor_images(self.sensor, self.options, stop)

    def _in_time(self) -> Callable[[DepthFrame], bool]:
        """Returns what tells whether an image comes before the time is up."""
        begun: list[int] = []

        def early(frame: DepthFrame) -> bool:
            begun.append(frame.time_ns)
            return self.seconds is None or frame.time_ns - begun[0] < self.seconds * 1e9

        return early

    def _kept(self, output: Path, since: int) -> bool:
        """Keeps the images beside what is made; returns whether that could be done."""
        try:
            keep_scan(self.scanner, kept_beside(output), since)
        except ResourceError as error:
            self._notes.append(f"The images were not kept for --add ({error.what}).")
            return False
        return bool(self.scanner.poses)
