"""Creates the plan of an installation: all files with their content, and all commands."""

from __future__ import annotations

import importlib.util
import shlex
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from enliven.errors import ResourceError
from enliven.files import read_file
from enliven.kiosk.profile import KioskProfile
from enliven.kiosk.programs import local_edges

from .profile_folder import list_profile_files

CONFIGURATION_FOLDER = Path("/etc/enliven")
"""Folder of the installed profile and its files."""
STATE_FOLDER = Path("/var/lib/enliven")
"""Folder for all files that the programs write, and for the record of the installation."""
RECORDINGS_FOLDER = STATE_FOLDER / "recordings"
"""Folder of recordings if the profile contains a relative path."""
PLACEMENTS = {
    "systemd/enliven-edge@.service": "/etc/systemd/system/enliven-edge@.service",
    "systemd/enliven-kiosk.service": "/etc/systemd/system/enliven-kiosk.service",
    "systemd/enliven-health.service": "/etc/systemd/system/enliven-health.service",
    "systemd/enliven-backoff.service": "/etc/systemd/system/enliven-backoff.service",
    "systemd/enliven-backoff.timer": "/etc/systemd/system/enliven-backoff.timer",
    "systemd/enliven-souvenirs.service": "/etc/systemd/system/enliven-souvenirs.service",
    "systemd/enliven-nightly.service": "/etc/systemd/system/enliven-nightly.service",
    "systemd/enliven-nightly.timer": "/etc/systemd/system/enliven-nightly.timer",
    "systemd/enliven-journald.conf": "/etc/systemd/journald.conf.d/50-enliven.conf",
    "systemd/enliven-sysusers.conf": "/etc/sysusers.d/enliven.conf",
    "systemd/enliven-modules.conf": "/etc/modules-load.d/enliven.conf",
    "udev/60-enliven-cameras.rules": "/etc/udev/rules.d/60-enliven-cameras.rules",
    "udev/60-enliven-controls.rules": "/etc/udev/rules.d/60-enliven-controls.rules",
}
"""Installed path of each file in firmware_configs."""
_SLEEP_UNITS = ("sleep.target", "suspend.target", "hibernate.target", "hybrid-sleep.target")
"""systemd units that would suspend an idle computer."""
_PACKAGES = ("enliven", "enliven_edge", "enliven_viewer")
"""Python packages of the kiosk's programs."""
_MAX_TEMPLATE_BYTES = 1 << 20
"""Maximum size in bytes of a file in firmware_configs."""


@dataclass(frozen=True)
class PlannedFile:
    """One file or symbolic link of an installation.

    Attributes:
        place: the absolute path of the file or link.
        content: the file's bytes. None for a copy of ``source``, or for a link.
        source: the file to copy.
        link: target of the symbolic link.
        is_secret: True if only the kiosk's user may read it.
    """

    place: Path
    content: bytes | None = None
    source: Path | None = None
    link: str = ""
    is_secret: bool = False


@dataclass(frozen=True)
class InstallPlan:
    """An installation.

    Attributes:
        files: all files and links, in the order in which they are written.
        units: systemd units to enable and start.
        setup_commands: commands to run before the units are enabled.
        apply_commands: commands that apply the files without a restart of the computer. They may fail.
        recordings: folder of recordings, which is created for the kiosk's user. None if nothing is recorded.
    """

    files: tuple[PlannedFile, ...]
    units: tuple[str, ...]
    setup_commands: tuple[tuple[str, ...], ...]
    apply_commands: tuple[tuple[str, ...], ...]
    recordings: Path | None


def create_plan(
    settings: KioskProfile, profile: Path, *, cage: str = "/usr/bin/cage", python: str = sys.executable
) -> InstallPlan:
    """Returns the plan for a kiosk.

    Args:
        settings: the profile.
        profile: path of the profile's file. The folder of this file is installed.
        cage: path of the compositor.
        python: path of the Python interpreter with which enliven is installed.

    Raises:
        InputError: if the profile's folder cannot be installed.
        ResourceError: if the templates are missing.
    """
    installed = CONFIGURATION_FOLDER / profile.name
    recordings = _recordings_folder(settings)
    values = {
        "@ENLIVEN@": f"{_quote_for_systemd(python)} -m enliven",
        "@PYTHON@": _quote_for_systemd(python),
        "@PROFILE@": _quote_for_systemd(str(installed)),
        "@CAGE@": _quote_for_systemd(cage),
        "@SYSTEMCTL@": "/usr/bin/systemctl",
        "@FROZEN_AFTER@": f"{settings.care.frozen_after:g}",
        "@RESTART_AT@": settings.care.restart_at,
        "@PROTECT_HOME@": "read-only" if _is_in_home(python) else "yes",
        "@READ_WRITE@": f"ReadWritePaths=-{_quote_for_systemd(str(recordings))}" if recordings else "",
    }
    files = [*_template_files(values, settings), *_profile_files(profile)]
    if recordings == RECORDINGS_FOLDER:
        files.append(
            PlannedFile(CONFIGURATION_FOLDER / settings.care.recordings, link=str(RECORDINGS_FOLDER))
        )
    files += [PlannedFile(Path("/etc/systemd/system") / unit, link="/dev/null") for unit in _SLEEP_UNITS]
    return InstallPlan(
        tuple(files),
        _autostart_units(settings),
        (("systemd-sysusers", "enliven.conf"),),
        (
            (python, "-m", "compileall", "-q", *_code_folders()),
            ("udevadm", "control", "--reload"),
            ("udevadm", "trigger"),
            ("systemctl", "restart", "systemd-journald.service"),
            ("systemctl", "restart", "systemd-modules-load.service"),
        ),
        recordings,
    )


def _recordings_folder(settings: KioskProfile) -> Path | None:
    """Returns the folder of recordings. A relative path in the profile is relative to the state folder."""
    if not settings.care.recordings:
        return None
    configured = Path(settings.care.recordings)
    return configured if configured.is_absolute() else RECORDINGS_FOLDER


def _autostart_units(settings: KioskProfile) -> tuple[str, ...]:
    """Returns the units of a kiosk that start with the computer."""
    units = [f"enliven-edge@{name}.service" for name in local_edges(settings)]
    units += ["enliven-kiosk.service", "enliven-health.service", "enliven-backoff.timer"]
    if settings.souvenir.kind:
        units.append("enliven-souvenirs.service")
    if settings.care.restart_at:
        units.append("enliven-nightly.timer")
    return tuple(units)


def _template_files(values: dict[str, str], settings: KioskProfile) -> list[PlannedFile]:
    """Returns the files in firmware_configs with the values of this installation filled in."""
    folder = _firmware_configs()
    files = []
    for name, place in PLACEMENTS.items():
        if "nightly" in name and not settings.care.restart_at:
            continue
        if "souvenirs" in name and not settings.souvenir.kind:
            continue
        text = read_file(folder / name, _MAX_TEMPLATE_BYTES).decode()
        for key, value in values.items():
            text = text.replace(key, value)
        files.append(PlannedFile(Path(place), text.encode()))
    return files


def _profile_files(profile: Path) -> list[PlannedFile]:
    """Returns copies of all files in a profile's folder."""
    folder = profile.absolute().parent
    return [
        PlannedFile(CONFIGURATION_FOLDER / path.relative_to(folder), source=path, is_secret=is_secret)
        for path, is_secret in list_profile_files(profile)
    ]


def _code_folders() -> list[str]:
    """Returns the folders of enliven's code, for which byte code must be compiled during installation.

    The kiosk's user cannot write byte code to these folders. Without byte code, each start would compile all
    modules again, which takes a second. pip writes byte code for a wheel, but not for an editable
    installation.
    """
    specs = [importlib.util.find_spec(package) for package in _PACKAGES]
    return [
        folder for spec in specs if spec is not None for folder in (spec.submodule_search_locations or [])
    ]


def _firmware_configs() -> Path:
    """Returns the folder firmware_configs: in the package of the edge, or in a checkout.

    Raises:
        ResourceError: if neither exists.
    """
    spec = importlib.util.find_spec("enliven_edge")
    for package in (spec.submodule_search_locations or []) if spec is not None else []:
        for root in (Path(package), Path(package).parent.parent):
            if (root / "firmware_configs" / "systemd").is_dir():
                return root / "firmware_configs"
    raise ResourceError(
        "the systemd units were not found",
        where="enliven-edge",
        remedy="Install the package: pip install enliven-edge",
    )


def _quote_for_systemd(path: str) -> str:
    """Returns a path quoted as a word of a systemd unit. Percent signs are doubled, because a single one
    would begin a specifier.
    """
    return shlex.quote(path).replace("%", "%%")


def _is_in_home(python: str) -> bool:
    """Returns True if a Python interpreter is in a home directory. Then services need read access to home
    directories."""
    return any(Path(python).is_relative_to(home) for home in ("/home", "/root"))


def command_line(words: Sequence[str]) -> str:
    """Returns a command as text for a shell."""
    return shlex.join(words)
