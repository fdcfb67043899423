"""Recognises a puppet's name on a command line, without importing the modules that a puppet needs."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from enliven.document import Project


def _cactus() -> Project:
    from enliven.samples import cactus_project

    return cactus_project()


MADE = {"cactus": _cactus}
"""The puppets that ship, by name instead of by path."""
ENDINGS = (".toml", ".enliven")
"""The endings of files that a puppet is read from."""


def is_puppet(spec: str) -> bool:
    """Returns whether a spec names a puppet: a session, or a project, perhaps with a name behind #."""
    return spec in MADE or Path(file_of(spec)[0]).suffix.lower() in ENDINGS


def file_of(spec: str) -> tuple[str, str]:
    """Returns the file and the name of the puppet in it; the name is empty where none is given."""
    file, mark, name = spec.rpartition("#")
    return (file, name) if mark and Path(file).suffix.lower() in ENDINGS else (spec, "")
