"""Recordings as cameras of Orbbec's library, which plays files of its own layout."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

from enliven.errors import InputError
from enliven_edge.sensors.drivers.playback import write_playback
from enliven_edge.sensors.drivers.refusals import in_a_line


def playbacks(ob: Any, path: str) -> list[tuple[Any, int]]:
    """The cameras that play a recording of ours or of Orbbec's, one after the other: each has one lens.

    Returns:
        each with nanoseconds to add to a played time for the recording's.

    Raises:
        InputError: for a recording that cannot be used.
    """
    with tempfile.TemporaryDirectory(prefix="enliven-", ignore_cleanup_errors=True) as folder:
        if Path(path).suffix == ".bag":
            from enliven_edge.importing.bags import check_playback

            check_playback(Path(path))
            files = [(Path(path), 0)]
        else:
            written = write_playback(path, Path(folder) / "rehearsal.bag")
            files = [(part.path, part.shift_ns) for part in written]
        # The library has the files open; they go with their last user.
        try:
            return [(ob.PlaybackDevice(str(file)), shift_ns) for file, shift_ns in files]
        except ob.OBError as error:
            what = f"Orbbec's library cannot play it ({in_a_line(error)})"
            raise InputError(what, where=path) from None
