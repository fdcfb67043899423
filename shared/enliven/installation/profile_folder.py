"""The folder of a kiosk's profile, which is installed as a whole."""

from __future__ import annotations

import stat
from collections.abc import Iterator
from pathlib import Path

from enliven.errors import InputError
from enliven.kiosk.profile import KioskProfile
from enliven.kiosk.programs import BUILT_IN_MESHES

MAX_FILES = 2000
"""Maximum number of files in a profile's folder. A folder with more files is probably a home directory."""
MAX_BYTES = 4 << 30
"""Maximum total size in bytes of the files in a profile's folder. It is enough for some meshes and an hour of
performances."""
_SECRET_MODE_MASK = 0o077
"""Permission bits of other users. A file without any of these bits is a secret."""


def list_profile_files(profile: Path) -> Iterator[tuple[Path, bool]]:
    """Yields each file below the folder of a profile, and True if it is secret. Hidden files are left out.

    Raises:
        InputError: if the folder is a home directory or the root, or is too large for a kiosk.
    """
    folder = profile.absolute().parent
    remedy = "Move the profile and its files to a separate folder."
    if folder in (Path("/"), Path.home()) or folder.parent == Path("/home"):
        raise InputError(
            "the installation would copy this whole folder, because the profile is in it",
            where=str(folder),
            remedy=remedy,
        )
    count = size = 0
    for path in sorted(folder.rglob("*")):
        if not path.is_file() or any(part.startswith(".") for part in path.relative_to(folder).parts):
            continue
        status = path.stat()
        count, size = count + 1, size + status.st_size
        if count > MAX_FILES or size > MAX_BYTES:
            raise InputError(
                "the folder of the profile is too large for a kiosk", where=str(profile), remedy=remedy
            )
        yield path, not stat.S_IMODE(status.st_mode) & _SECRET_MODE_MASK


def find_outside_files(settings: KioskProfile, profile: Path) -> list[InputError]:
    """Returns a mistake for each file outside of the profile's folder that the profile refers to, because
    such files are not installed.
    """
    named_files = {f"characters.{name}.mesh": c.mesh for name, c in settings.characters.items()}
    named_files |= {f"edges.{name}.settings": edge.settings for name, edge in settings.edges.items()}
    named_files |= {f"story.attract {number}": path for number, path in enumerate(settings.story.attract, 1)}
    named_files["zone.space"] = settings.zone.space
    health = settings.health
    named_files |= {"health.password_file": health.password_file, "health.certificate": health.certificate}
    named_files |= {"health.certificate_key": health.certificate_key}
    named_files |= {"souvenir.certificate": settings.souvenir.certificate}
    named_files |= {"souvenir.certificate_key": settings.souvenir.certificate_key}
    folder = profile.absolute().parent.resolve()
    mistakes = []
    for key, name in named_files.items():
        if not name or name in BUILT_IN_MESHES:
            continue
        if Path(name).is_absolute() or not (folder / name).resolve().is_relative_to(folder):
            remedy = f"Move the file into {folder}, and write its path relative to that folder."
            mistakes.append(
                InputError(
                    f"the file in {key} is outside the profile's folder", where=str(profile), remedy=remedy
                )
            )
    return mistakes
