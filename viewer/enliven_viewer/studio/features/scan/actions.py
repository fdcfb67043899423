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
        about="Carry the camera round an object to make it a character.",
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
        about="Use this after a hand came into view, or the camera moved too fast.",
    )
    yield Action(
        "scan.done",
        "Scan",
        "Done: make it a character",
        (),
        scan.finish,
        scan.describe_missing_scan,
        about="The object is cut out, put on the stage, and can be possessed.",
    )
    yield Action("scan.cancel", "Scan", "Cancel the scan", (), scan.cancel, scan.describe_missing_scan)
    yield Action(
        "scan.again",
        "Scan",
        "Add to the scan",
        (),
        scan.continue_scan,
        scan.describe_missing_repeat,
        about="Continues the scan to fill gaps.",
        apart=True,
    )
