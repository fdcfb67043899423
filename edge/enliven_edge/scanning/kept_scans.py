"""Stores scans next to their mesh, as images with poses, so that they can be continued."""

from __future__ import annotations

import threading
from collections import Counter
from dataclasses import replace
from pathlib import Path

from enliven.errors import InputError
from enliven.files import replace_file
from enliven.recording import Recorder, Recording
from enliven.scanning import Scanner, ScanState
from enliven.scanning.objects.moved_scanner import MovedScanner
from enliven_edge.scanning.sources import read_recorded_images

STORED_SCAN_SUFFIX = ".scan.mcap"
"""File suffix of the recording of a stored scan."""
_METADATA_NAME = "kept scan"
"""Name of the metadata record that marks a recording with poses of a scan."""
_SYNC_INTERVAL_S = 10.0
"""Seconds between two syncs to disk. The syncs protect long scans. The recording has a temporary name until
it is complete."""


def find_stored_scan_path(path: Path) -> Path:
    """Returns the path of the stored scan of a mesh or a project."""
    return path.with_name(path.stem + STORED_SCAN_SUFFIX)


def store_scan(scanner: Scanner | MovedScanner, path: Path, since: int = 0) -> None:
    """Writes the images of a scan with their poses as an ordinary recording.

    If the object was moved, only the scan before the move is written.

    Args:
        since: number of the first image.

    Raises:
        ResourceError: if it cannot be written. No partial file is left.
    """
    with (
        replace_file(path) as part,
        Recorder(part, sync_seconds=_SYNC_INTERVAL_S, overwrite=True) as recorder,
    ):
        numbers = [number for number in scanner.history.numbers if number >= since]
        recorder.add_metadata(_METADATA_NAME, {"images": str(len(numbers))})
        for number, frame in scanner.history.frames(numbers):
            recorder.write_frame(replace(frame, world_from_camera=scanner.poses[number][1]))


def load_first_part(scanner: Scanner, path: Path, stop: threading.Event) -> int:
    """Continues an earlier scan: loads it, or scans its recording. Returns the number of images.

    Args:
        path: a mesh or a project with a stored scan next to it, or a recording.

    Raises:
        InputError: if no scan is stored for the mesh or project, or if its images cannot be scanned.
    """
    source = path if path.suffix.lower() == ".mcap" else find_stored_scan_path(path)
    if path.exists() and not source.exists():
        problem = f"the images of this scan were not saved: {source.name} is missing"
        raise InputError(
            problem, where=str(path), remedy="Use the recording of this scan instead, or scan again."
        )
    has_poses = _METADATA_NAME in Recording(source).info.metadata
    states: Counter[ScanState] = Counter()
    for frame in read_recorded_images(source, stop):
        if has_poses and frame.world_from_camera is not None:
            scanner.place(frame, frame.world_from_camera)
        else:
            states[scanner.add(frame).state] += 1
    if 2 * states[ScanState.UNSURE] > states.total():
        problem = "the recording shows little more than one blank surface, so the camera cannot be located"
        raise InputError(problem, where=str(source), remedy="Keep other objects in view, too.")
    if not scanner.poses:
        problem = "no frame of the recording shows enough depth"
        raise InputError(problem, where=str(source), remedy="Choose a recording of the same place or object.")
    scanner.look_again()
    return len(scanner.poses)


def check_registered(registered_count: int, path: Path) -> None:
    """Raises an error if no new image could be registered to the earlier scan.

    Args:
        registered_count: number of registered images.

    Raises:
        InputError: if the number is 0.
    """
    if not registered_count:
        problem = "no part of the earlier scan was seen again, so the new images cannot be aligned"
        remedy = (
            "Start with a part that the earlier scan shows, from a similar viewpoint. Hold still for a "
            "moment."
        )
        raise InputError(problem, where=str(path), remedy=remedy)
