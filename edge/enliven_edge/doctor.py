"""The edge's checks of this machine: sensors, recordings, permissions."""

from __future__ import annotations

from importlib import resources
from pathlib import Path

from enliven.doctor import Check
from enliven_edge.camera_preview import PRIVACY_NOTE
from enliven_edge.sensors import crash_reports, list_attached, profile_names, sensor_names


def checks() -> list[Check]:
    """Returns the checks of sensors, sensor profiles, the shipped recording and depth cameras on USB, and a
    privacy note.
    """
    return [
        Check("sensors", True, ", ".join(sensor_names())),
        Check(
            "sensor profiles",
            bool(profile_names()),
            ", ".join(profile_names()),
            "Install enliven-edge again.",
        ),
        _check_recording(),
        *_check_cameras(),
        list_crash_reports(),
        Check("camera preview", True, f"by default, {PRIVACY_NOTE}"),
    ]


def _check_recording() -> Check:
    """Checks the recording that ``enliven run`` replays."""
    path = find_shipped_recording()
    remedy = "Create the recording again: enliven synthesize -o chair.mcap"
    return Check("shipped recording", path.is_file(), path.name if path.is_file() else "not found", remedy)


def list_crash_reports() -> Check:
    """Lists the stored crash reports. Stored reports are not a failed check."""
    reports = crash_reports.list_stored_reports()
    detail = "\n".join([f"{len(reports)} stored in {crash_reports.reports_folder()}", *map(str, reports)])
    return Check("crash reports", True, detail if reports else "none stored")


def find_shipped_recording() -> Path:
    """Returns the path of the recording that is shipped with the package."""
    return Path(str(resources.files("enliven_edge") / "assets" / "chair.mcap"))


def _check_cameras() -> list[Check]:
    """Checks each depth camera on USB that the system lists."""
    checks = []
    for camera in list_attached():
        problems = camera.find_problems()
        detail = ", ".join([camera.title, *(problem for problem, _ in problems)])
        checks.append(
            Check(camera.kind.name, not problems, detail, " ".join(remedy for _, remedy in problems))
        )
    return checks
