"""Writes animated characters as a single web page (.html) that works offline in every current browser.

The page contains the viewer of ``enliven web`` with three.js. The characters are stored as network messages:
one character message, and one encoded pose per frame. All messages form one MessagePack map, which is
compressed by gzip and encoded in base64. docs/written-files.md describes the map.
"""

from __future__ import annotations

import base64
import gzip
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from enliven.errors import InputError
from enliven.exporters.performance import Performance
from enliven.exporters.registry import Exporter
from enliven.exporters.wire_characters import wire_characters
from enliven.files import write_file
from enliven.web_page.page_files import make_standalone_page
from enliven.wire import PoseCodec, character_to_message, pack_payload

MAX_PAGE_MB = 256
"""Maximum size of a page in megabytes. A browser needs several times this size for the text, the unpacked
take and the images. Phones do not have more memory.
"""
_REMEDY = "Choose another output file."


def write_html(
    path: Path | str,
    performances: Sequence[Performance],
    name: str = "enliven",
    progress: Callable[[float], object] | None = None,
) -> None:
    """Writes the performances as one page with play and pause buttons, a timeline and an orbit camera.

    Args:
        name: the title.
        progress: called with the finished fraction. An exception that it raises ends the export.

    Raises:
        InputError: if a character is too large for network messages, or the page exceeds :data:`MAX_PAGE_MB`.
        ResourceError: if the file cannot be written.
    """
    frames = max(sum(len(performance.times) for performance in performances), 1)
    finished, tracks, size = 0, list[dict[str, Any]](), 0
    for character, performance in zip(wire_characters(performances), performances, strict=True):
        payload, codec = pack_payload(character_to_message(character, 1)), PoseCodec(character)
        poses = list[bytes]()
        for pose in performance.poses():
            poses.append(codec.encode(pose).data)
            finished += 1
            if progress is not None:
                progress(0.9 * finished / frames)
        size += len(payload) + sum(map(len, poses))
        _check_size(size, path)
        times = np.asarray(performance.times, "<f8").tobytes()
        tracks.append({"payload": payload, "times": times, "poses": poses})
    seconds = max((float(performance.times[-1]) for performance in performances), default=0.0)
    take = msgspec.msgpack.encode({"title": name, "seconds": seconds, "characters": tracks})
    # Set the compression time to 0, so that equal takes give equal files.
    page = make_standalone_page(name, base64.b64encode(gzip.compress(take, 6, mtime=0)).decode())
    if progress is not None:
        progress(1.0)
    write_file(Path(path), page, _REMEDY)


HTML = Exporter(write_html, placements=("scale", "in_place"))


def _check_size(size: int, path: Path | str) -> None:
    """Raises InputError if a take is too large for browsers."""
    if size > MAX_PAGE_MB * 1_000_000:
        raise InputError(
            f"the page would be larger than {MAX_PAGE_MB} MB",
            where=str(path),
            remedy="Choose fewer characters (--character), a shorter range (--end) or a lower --rate.",
        )
