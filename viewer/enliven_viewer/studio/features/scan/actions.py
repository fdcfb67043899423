"""The actions of scanning, for menus, command palette and the panel's buttons."""

from __future__ import annotations

from collections.abc import Iterator

from enliven_viewer.studio.actions.action import Action
from enliven_viewer.studio.features.scan.session import ScanSession


def make_scan_actions(scan: ScanSession) -> Iterator[Action]:
    """Yields every action of scanning."""
    yield Action(
        "scan.open",
        "Scan",
        "Scan...",
        ("ctrl+shift+n",),
        scan.open,
        about="Scans a real object as a character: carry the camera round the object.",
    )
    yield Action("scan.start", "Scan", "Start a scan", (), scan.start, scan.describe_missing_stage)
    yield Action(
        "scan.pause",
        "Scan",
        "Pause or continue",
        (),
        scan.pause,
        scan.describe_missing_scan,
        is_on=lambda: scan.message.phase == "paused",
        apart=True,
    )
    yield Action(
        "scan.undo",
        "Scan",
        "Undo the last seconds",
        (),
        scan.undo,
        scan.describe_missing_undo,
        about=(
            "Removes the last seconds of the scan, for example after a hand came into view or the camera "
            "moved too fast."
        ),
    )
    yield Action(
        "scan.done",
        "Scan",
        "Done: make the character",
        (),
        scan.finish,
        scan.describe_missing_scan,
        about="Ends the scan, and puts the object on the stage as a character that you can possess.",
    )
    yield Action("scan.cancel", "Scan", "Cancel the scan", (), scan.cancel, scan.describe_missing_scan)
    yield Action(
        "scan.again",
        "Scan",
        "Add to the scan",
        (),
        scan.continue_scan,
        scan.describe_missing_repeat,
        about="Continues the last scan to fill gaps.",
        apart=True,
    )
