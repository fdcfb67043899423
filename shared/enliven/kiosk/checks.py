"""Checks a kiosk's profile before any program starts, and reports all mistakes at once."""

from __future__ import annotations

import os
import re
import socket
import stat
from collections.abc import Callable, Iterator
from importlib.metadata import entry_points
from pathlib import Path
from typing import Any

from enliven.errors import EnlivenError, InputError, ResourceError
from enliven.files import is_file
from enliven.settings import load_settings, read_toml
from enliven.space.space_file import load_space
from enliven.supervision.schedule import parse_time_of_day

from .mounts import find_mount
from .profile import KioskCharacter, KioskProfile, load_profile
from .programs import BUILT_IN_MESHES, local_edges
from .souvenir_address import check_souvenir_address

ENTRY_POINTS = "enliven.kiosk_checks"
"""Group of entry points. Each is a function that takes a profile and its path, and yields the mistakes that
only its own package can recognise, such as a wrong setting of an edge."""
_NAME_PATTERN = re.compile(r"[A-Za-z0-9_-]{1,40}")
"""Pattern of the names of edges and characters. They become parts of file names and of the names of systemd
units."""
_SIZE_PATTERN = re.compile(r"[1-9]\d{1,4}x[1-9]\d{1,4}")
"""Pattern of the window's size, such as 1920x1080."""
_TABLES_OF_TABLES = ("edges", "characters")
"""Keys of a profile that have tables by name as values."""


def find_mistakes(path: Path, *, starts_here: bool = True) -> list[EnlivenError]:
    """Returns all mistakes in a kiosk's profile and in the files that it refers to. If the list is empty, the
    kiosk can start.

    Args:
        path: the profile (TOML).
        starts_here: False does not check for ports in use and for the folder of recordings. It is used for an
            installation, which creates this folder. Its kiosk may already be running.
    """
    try:
        profile = load_profile(path)
    except EnlivenError as error:
        return _find_wrong_tables(path) or [error]
    return list(_find_profile_mistakes(profile, path, starts_here))


def _find_wrong_tables(path: Path) -> list[EnlivenError]:
    """Returns one mistake for each invalid table of a profile. The list is empty if the file is not TOML."""
    try:
        tables = read_toml(path)
    except EnlivenError:
        return []
    parts: list[dict[str, Any]] = []
    for key, value in tables.items():
        if key in _TABLES_OF_TABLES and isinstance(value, dict):
            parts += [{key: {name: entry}} for name, entry in value.items()]
        elif isinstance(value, dict):
            parts += [{key: {inner: entry}} for inner, entry in value.items()]
        else:
            parts.append({key: value})
    loads = (
        _catch_error(lambda part=part: load_settings(KioskProfile, part, where=str(path))) for part in parts
    )
    return [error for error in loads if error is not None]


def _find_profile_mistakes(profile: KioskProfile, path: Path, starts_here: bool) -> Iterator[EnlivenError]:
    """Yields the mistakes in a profile without unknown keys."""
    folder = path.parent
    for kind, names in (("an edge", profile.edges), ("a character", profile.characters)):
        for name in names:
            if not _NAME_PATTERN.fullmatch(name):
                remedy = "Use 1 to 40 letters, digits, '-' and '_'."
                yield InputError(f"{name!r} is not a valid name for {kind}", where=str(path), remedy=remedy)
    for name, character in profile.characters.items():
        yield from _find_character_mistakes(name, character, path)
    yield from _find_missing_settings(profile, path)
    yield from _find_missing_files(profile, path)
    yield from _find_space_mistakes(profile, path)
    yield from _find_wrong_words(profile, path)
    for entry in sorted(entry_points(group=ENTRY_POINTS)):
        yield from entry.load()(profile, path)
    error = _catch_error(lambda: check_souvenir_address(profile.souvenir, str(path)))
    if error is not None:
        yield error
    if starts_here:
        yield from _find_recording_mistakes(profile, folder)
        yield from _find_taken_ports(profile)


def _find_character_mistakes(name: str, character: KioskCharacter, path: Path) -> Iterator[EnlivenError]:
    """Yields the mistakes in the settings of one character."""
    if character.mesh not in BUILT_IN_MESHES and not is_file(path.parent / character.mesh):
        yield InputError(
            f"the mesh file {character.mesh} in characters.{name} does not exist",
            where=str(path),
            remedy=f"Relative paths start at the folder {path.parent}. Built-in meshes: "
            f"{', '.join(sorted(BUILT_IN_MESHES))}.",
        )
    from enliven.person import parse_parts

    if character.parts:
        words = [part.strip() for part in character.parts.split("/")]
        error = _catch_error(lambda: parse_parts(words))
        if error is not None:
            yield InputError(error.what, where=f"{path}, characters.{name}.parts", remedy=error.remedy)


def _find_missing_settings(profile: KioskProfile, path: Path) -> Iterator[EnlivenError]:
    """Yields the settings files of edges that do not exist."""
    for name, edge in profile.edges.items():
        if edge.settings and not is_file(path.parent / edge.settings):
            yield InputError(
                f"the settings file {edge.settings} in edges.{name} does not exist",
                where=str(path),
                remedy=f"Relative paths start at the folder {path.parent}.",
            )


def _find_missing_files(profile: KioskProfile, path: Path) -> Iterator[EnlivenError]:
    """Yields the missing files, and secret files that other users can read."""
    health, souvenir, folder = profile.health, profile.souvenir, path.parent
    files = [("story.attract", performance) for performance in profile.story.attract]
    files.append(("zone.space", profile.zone.space))
    files += [("health.password_file", health.password_file), ("health.certificate", health.certificate)]
    files += [("health.certificate_key", health.certificate_key)]
    files += [("souvenir.certificate", souvenir.certificate)]
    files += [("souvenir.certificate_key", souvenir.certificate_key)]
    for key, name in files:
        if name and not is_file(folder / name):
            yield InputError(
                f"the file {name} in {key} does not exist",
                where=str(path),
                remedy=f"Relative paths start at the folder {folder}.",
            )
    for name in dict.fromkeys((health.password_file, health.certificate_key, souvenir.certificate_key)):
        secret = folder / name
        if name and is_file(secret) and stat.S_IMODE(secret.stat().st_mode) & 0o077:
            yield InputError(
                "other users can read this secret file", where=str(secret), remedy=f"Type: chmod 600 {secret}"
            )


def _find_space_mistakes(profile: KioskProfile, path: Path) -> Iterator[EnlivenError]:
    """Yields a mistake if the space file cannot be read, or if it contains no place for an edge of this
    computer."""
    file = path.parent / profile.zone.space
    if not profile.zone.space or not is_file(file):
        return
    try:
        places = load_space(file).sensors
    except EnlivenError as error:
        yield error
        return
    missing = [name for name in local_edges(profile) if name not in places]
    if missing and len(profile.edges) > 1:
        yield InputError(
            f"the space file has no position for {', '.join(f'edges.{name}' for name in missing)}",
            where=str(file),
            remedy=f"The file has positions for these names: {', '.join(places)}. Use these names for the "
            "edges, or calibrate the edges.",
        )


def _find_wrong_words(profile: KioskProfile, path: Path) -> Iterator[EnlivenError]:
    """Yields a mistake for an invalid screen size, and for an invalid time of day."""
    size = profile.screen.size
    if size and not _SIZE_PATTERN.fullmatch(size):
        yield InputError(
            f"the size {size!r} in screen.size is not valid",
            where=str(path),
            remedy="Write the size like 1920x1080.",
        )
    if profile.care.restart_at:
        error = _catch_error(lambda: parse_time_of_day(profile.care.restart_at))
        if error is not None:
            yield InputError(error.what, where=f"{path}, {error.where}", remedy=error.remedy)


def _find_recording_mistakes(profile: KioskProfile, folder: Path) -> Iterator[EnlivenError]:
    """Yields a mistake if the folder of recordings is missing, cannot be written, or loses its files at power
    off."""
    if not profile.care.recordings:
        return
    recordings = folder / profile.care.recordings
    if not recordings.is_dir():
        problem = "the folder for recordings does not exist"
        yield ResourceError(problem, where=str(recordings), remedy=f"Type: mkdir -p {recordings}")
        return
    if not os.access(recordings, os.W_OK):
        yield ResourceError(
            "this user cannot write recordings to the folder",
            where=str(recordings),
            remedy="Give this user write permission for the folder.",
        )
    mount = find_mount(recordings)
    if mount is not None and mount.is_volatile:
        yield ResourceError(
            f"recordings in this folder are lost at power off ({mount.kind} on {mount.place})",
            where=str(recordings),
            remedy="Store recordings on a separate partition that is not part of the read-only root.",
        )


def _find_taken_ports(profile: KioskProfile) -> Iterator[EnlivenError]:
    """Yields a mistake for each port that another program uses."""
    needed_ports: dict[int, tuple[str, str]] = {}
    for name, edge in local_edges(profile).items():
        needed_ports[edge.port] = needed_ports[edge.port + 1] = ("127.0.0.1", f"edges.{name}.port")
    pages = [(profile.health.port, profile.health.host, "health.port")]
    if profile.souvenir.kind:
        pages.append((profile.souvenir.port, profile.souvenir.host, "souvenir.port"))
    for port, host, key in pages:
        if port in needed_ports:
            yield ResourceError(
                f"{key} and {needed_ports[port][1]} use the same port",
                where=f"port {port}",
                remedy="Choose another port.",
            )
        needed_ports[port] = (host, key)
    for port, (host, key) in needed_ports.items():
        if not _is_free(host, port):
            yield ResourceError(
                f"another program already uses the port in {key}",
                where=f"port {port}",
                remedy=f"End the other program (ss -tlnp 'sport = {port}' shows its name), or choose another "
                "port.",
            )


def _is_free(host: str, port: int) -> bool:
    """Returns True if a program can listen at a port."""
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    with socket.socket(family, socket.SOCK_STREAM) as listener:
        # Without this option, a port of a program that has just ended would count as used.
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            listener.bind((host, port))
        except OSError:
            return False
    return True


def _catch_error(check: Callable[[], object]) -> EnlivenError | None:
    """Returns the error that a check raises, or None."""
    try:
        check()
    except EnlivenError as error:
        return error
    return None
