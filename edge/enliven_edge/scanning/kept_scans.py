"""Scans that are kept beside what they became, so that more can be added: their images, with their poses."""

from __future__ import annotations

import threading
from collections import Counter
from dataclasses import replace
from pathlib import Path

from enliven.errors import InputError
from enliven.files import replace_file
from enliven.recording import Recorder, Recording
from enliven.scanning import Scanner, ScanState
from enliven.scanning.objects import MovedScanner
from enliven_edge.scanning.sources import recorded_images

KEPT = ".scan.mcap"
"""Ending of the recording of a kept scan."""
_FACT = "kept scan"
"""The record of a recording that says that its poses are those of a scan."""
_SYNC = 10.0
"""Seconds between two writes to the disk; the recording is written under another name until it is whole."""


def kept_beside(path: Path) -> Path:
    """Returns where the scan of a mesh or a project is kept."""
    return path.with_name(path.stem + KEPT)


def keep_scan(scanner: Scanner | MovedScanner, path: Path, since: int = 0) -> None:
    """Writes the images of a scan with their poses, as a recording that any program of this project opens.

    Of an object that was moved it is the scan until then.

    Args:
        since: number of the first one.

    Raises:
        ResourceError: where it cannot be written; nothing is left behind.
    """
    with (
        replace_file(path) as part,
        Recorder(part, sync_seconds=_SYNC, overwrite=True) as recorder,
    ):
        numbers = [number for number in scanner.history.numbers if number >= since]
        recorder.add_metadata(_FACT, {"images": str(len(numbers))})
        for number, frame in scanner.history.frames(numbers):
            recorder.write_frame(replace(frame, world_from_camera=scanner.poses[number][1]))


def scan_first(scanner: Scanner, path: Path, stop: threading.Event) -> int:
    """Brings an earlier scan back, or scans a recording, as the first part of a scan; returns its images.

    Args:
        path: a mesh or a project beside which its scan was kept, or a recording.

    Raises:
        InputError: where nothing was kept of it, or nothing can be scanned in it.
    """
    source = path if path.suffix.lower() == ".mcap" else kept_beside(path)
    if path.exists() and not source.exists():
        what = f"its scan was not kept: there is no {source.name} beside it"
        raise InputError(what, where=str(path), mend="Give the recording of which it was made, or scan anew.")
    placed = _FACT in Recording(source).info.metadata
    states: Counter[ScanState] = Counter()
    for frame in recorded_images(source, stop):
        if placed and frame.world_from_camera is not None:
            scanner.place(frame, frame.world_from_camera)
        else:
            states[scanner.add(frame).state] += 1
    if 2 * states[ScanState.UNSURE] > states.total():
        what = "it shows hardly more than one blank surface, which does not tell where the camera is"
        raise InputError(what, where=str(source), mend="Let things that stand about be in view, too.")
    if not scanner.poses:
        what = "no frame of it shows enough depth"
        raise InputError(what, where=str(source), mend="Give a recording of the same place or thing.")
    scanner.look_again()
    return len(scanner.poses)


def refuse_unseen(found: int, path: Path) -> None:
    """Says that nothing of an earlier scan was seen again.

    Args:
        found: images that were laid onto it.

    Raises:
        InputError: where none was.
    """
    if not found:
        what = "nothing of it was seen again, so there is nothing to lay the new images onto"
        mend = "Begin with what both show, from where it was looked at before, and hold still for a moment."
        raise InputError(what, where=str(path), mend=mend)
