"""The edge's checks of this machine: sensors, recordings, permissions."""

from __future__ import annotations

from importlib import resources
from pathlib import Path

from enliven.doctor import Check
from enliven_edge.sensors import attached, crash_reports, profile_names, sensor_names


def checks() -> list[Check]:
    """Checks the known sensors, the profiles, the shipped recording, and each depth camera on USB."""
    return [
        Check("sensors", True, ", ".join(sensor_names())),
        Check(
            "sensor profiles",
            bool(profile_names()),
            ", ".join(profile_names()),
            "Install enliven-edge again.",
        ),
        _shipped_recording(),
        *_cameras(),
        _crashes(),
    ]


def _shipped_recording() -> Check:
    """Checks the recording that ``enliven run`` replays."""
    path = shipped_recording()
    mend = "Make it again: enliven synthesize -o chair.mcap"
    return Check("shipped recording", path.is_file(), path.name if path.is_file() else "not found", mend)


def _crashes() -> Check:
    """Lists the stored crash reports. Their existence does not count as a failure of this machine."""
    kept = crash_reports.reports()
    detail = "\n".join([f"{len(kept)} kept in {crash_reports.folder()}", *map(str, kept)])
    return Check("crash reports", True, detail if kept else "none kept")


def shipped_recording() -> Path:
    """Returns the path of the recording that comes with the package."""
    return Path(str(resources.files("enliven_edge") / "assets" / "chair.mcap"))


def _cameras() -> list[Check]:
    """Checks each depth camera on USB that the system lists."""
    checks = []
    for camera in attached():
        troubles = camera.troubles()
        detail = ", ".join([camera.title, *(problem for problem, _ in troubles)])
        checks.append(Check(camera.kind.name, not troubles, detail, " ".join(mend for _, mend in troubles)))
    return checks
