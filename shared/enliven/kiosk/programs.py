"""Builds the command lines of a kiosk's programs from its profile."""

from __future__ import annotations

from pathlib import Path

from .profile import KioskCharacter, KioskEdge, KioskProfile

BUILT_IN_MESHES = frozenset({"chair", "lamp", "cactus"})
"""Names of the characters that are built into enliven. They need no file."""
PART_MINUTES = 30
"""Duration of one file of a recording, in minutes. When the disk is full, the oldest files are deleted."""
_ALL_PARTS = "all"
"""Body parts of a character without this setting, if another character in the profile has it."""
_DEFAULT_DRIVE = "graph"
"""Drive of a character without this setting, if another character in the profile has it. This drive can move
every mesh."""


def edge_arguments(name: str, profile: KioskProfile, folder: Path, state: Path | None = None) -> list[str]:
    """Returns the arguments of the ``enliven`` command line that start an edge of a kiosk.

    Args:
        name: name of an edge of the profile, which runs on this computer.
        folder: folder of the profile, to which its paths are relative.
        state: folder in which the edge stores the state of its stage. If None, the state is not stored.
    """
    edge = profile.edges[name]
    settings = ["--settings", str(folder / edge.settings)] if edge.settings else []
    words = ["edge", *settings, *edge.arguments, *character_arguments(profile, folder)]
    words += ["--name", name, "--port", str(edge.port), "--control-port", str(edge.port + 1)]
    if state is not None:
        words += ["--keep-stage", str(state)]
    if profile.care.recordings:
        words += ["--record", str(folder / profile.care.recordings / f"{name}-{{time}}.mcap")]
        words += ["--part-minutes", str(PART_MINUTES), "--keep-free", f"{profile.care.keep_free:g}"]
    return words


def character_arguments(profile: KioskProfile, folder: Path) -> list[str]:
    """Returns the options of ``enliven edge`` for all characters of a profile."""
    characters = profile.characters
    words: list[str] = []
    for name, character in characters.items():
        words += ["--mesh", f"{name}={mesh_path(character, folder)}"]
    if any(character.parts for character in characters.values()):
        for character in characters.values():
            words += ["--parts", character.parts or _ALL_PARTS]
    if any(character.drive for character in characters.values()):
        for character in characters.values():
            words += ["--drive", character.drive or _DEFAULT_DRIVE]
    return words


def window_arguments(profile: Path) -> list[str]:
    """Returns the arguments of the ``enliven`` command line that open the window of a kiosk."""
    return ["kiosk-window", str(profile)]


def health_arguments(profile: Path) -> list[str]:
    """Returns the arguments of the ``enliven`` command line that serve the health page of a kiosk."""
    return ["health", str(profile)]


def souvenir_arguments(profile: Path) -> list[str]:
    """Returns the arguments of the ``enliven`` command line that serve the souvenirs of a kiosk."""
    return ["kiosk-souvenirs", str(profile)]


def mesh_path(character: KioskCharacter, folder: Path) -> str:
    """Returns the name of a built-in character, or the path of a character's file."""
    return character.mesh if character.mesh in BUILT_IN_MESHES else str(folder / character.mesh)


def local_edges(profile: KioskProfile) -> dict[str, KioskEdge]:
    """Returns the edges of a profile that run on this computer, by name."""
    return {name: edge for name, edge in profile.edges.items() if not edge.address}


def service_name(edge: str) -> str:
    """Returns the name of an edge for operators. The edge's record on the health page has the same name."""
    return "edge" if edge == "edge" else f"edge {edge}"
