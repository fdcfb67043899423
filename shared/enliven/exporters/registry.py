"""The registry of exporters: the suffix of a file name selects the exporter.

    exporter_of("out.glb").write(path, performances, "title")

A new exporter is one file with an :class:`Exporter` and one line here. In another package it is an entry
point of the group ``enliven.exporters``, named by the suffix without its dot.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from importlib.metadata import entry_points
from pathlib import Path
from typing import Any

from enliven.errors import InputError
from enliven.files import require_folder

ENTRY_POINTS = "enliven.exporters"
"""Entry-point group through which other packages add exporters. An entry point refers to an
:class:`Exporter`."""

_BUILT_IN = {
    "bvh": "enliven.exporters.bvh:BVH",
    "glb": "enliven.exporters.gltf:GLB",
}
_IN_PACKAGES = {"mp4": "enliven-viewer"}
"""File suffixes of exporters in packages that may not be installed, with the name of the package."""


@dataclass(frozen=True)
class Exporter:
    """An exporter for one kind of file.

    Attributes:
        write: takes the path, the performances, a title, and options as keywords.
        jointed: True if it supports only characters with a skeleton.
        single: True if it supports only one character.
        heard: True if it supports sound. ``write`` then takes ``sound``, the audio samples from the first
            pose on.
        keyed: True if it supports keys at uneven times, such as those of a clip's own file.
        check: takes the options and raises for invalid ones, before any work.
    """

    write: Callable[..., None]
    jointed: bool = False
    single: bool = False
    heard: bool = False
    keyed: bool = False
    check: Callable[..., object] = lambda **_: None


def suffixes() -> list[str]:
    """Returns the file suffixes that :func:`exporter_of` accepts, sorted."""
    return sorted(f".{name}" for name in {*_BUILT_IN, *(e.name for e in entry_points(group=ENTRY_POINTS))})


def exporter_of(path: Path | str, also: tuple[str, ...] = (), **options: Any) -> Exporter:
    """Returns the exporter of a file. Unsupported output is refused before any work.

    Args:
        also: suffixes that the caller writes itself, for the list of known suffixes in an error.
        options: options for its ``write``.

    Raises:
        InputError: for a suffix without an exporter, or an unknown or invalid option.
        ResourceError: if the folder is missing.
    """
    path = Path(path)
    exporter = _load_exporter(path.suffix.lower().removeprefix("."), str(path), also)
    parameters = inspect.signature(exporter.write).parameters
    for option in options:
        if option not in parameters:
            problem = f"{path.suffix.lower()} has no {option!r} to choose"
            raise InputError(problem, where=str(path), mend="Leave it out.")
    require_folder(path)
    exporter.check(**options)
    return exporter


def _load_exporter(name: str, where: str, also: tuple[str, ...]) -> Exporter:
    """Returns the exporter of that name.

    The exporter is imported on request, so that a missing library of one exporter does not disable the
    others.
    """
    if name in _BUILT_IN:
        module, _, attribute = _BUILT_IN[name].partition(":")
        exporter: Exporter = getattr(import_module(module), attribute)
        return exporter
    for entry in entry_points(group=ENTRY_POINTS):
        if entry.name == name:
            loaded: Exporter = entry.load()
            return loaded
    problem = f".{name} cannot be written" if name else "its name has no ending"
    package = _IN_PACKAGES.get(name)
    endings = ", ".join(sorted({*suffixes(), *also}))
    mend = f"Install its package: pip install {package}." if package else f"Known: {endings}."
    raise InputError(problem, where=where, mend=mend)
