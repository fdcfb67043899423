"""Recognises the name of a puppet on a command line, without importing the modules for puppets."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from enliven.document import Project


def _cactus() -> Project:
    from enliven.samples.shipped import cactus_project

    return cactus_project()


BUILT_IN_PUPPETS = {"cactus": _cactus}
"""The puppets that are part of enliven. They are given by name instead of by path."""
ENDINGS = (".toml", ".enliven")
"""Suffixes of files that may contain a puppet."""


def is_puppet(spec: str) -> bool:
    """Returns True if a spec names a puppet.

    It is a shipped puppet, a session, or a project with an optional name after "#".
    """
    return spec in BUILT_IN_PUPPETS or Path(puppet_file(spec)[0]).suffix.lower() in ENDINGS


def puppet_file(spec: str) -> tuple[str, str]:
    """Returns the file and the name of the puppet in it. The name is empty if none is given."""
    file, mark, name = spec.rpartition("#")
    return (file, name) if mark and Path(file).suffix.lower() in ENDINGS else (spec, "")
