"""The registry of exporters: the ending of a file's name says how performances are written to it.

    exporter_of("out.glb").write(path, performances, "title")

A new exporter is one file with an :class:`Exporter` and one line here, or in another package an entry point
of the group ``enliven.exporters``, named by the ending without its dot.
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
from enliven.files import need_folder

ENTRY_POINTS = "enliven.exporters"
"""Other packages add exporters through this group: an entry point names an :class:`Exporter`."""

_BUILT_IN = {
    "bvh": "enliven.exporters.bvh:BVH",
    "glb": "enliven.exporters.gltf:GLB",
}
_IN_PACKAGES = {"mp4": "enliven-viewer"}
"""Endings that packages add which may not be installed, by the name of the package."""


@dataclass(frozen=True)
class Exporter:
    """A kind of file that performances are written to.

    Attributes:
        write: takes the path, the performances, a title, and options as keywords.
        jointed: it holds only characters with a skeleton.
        single: it holds only one character.
        heard: it holds sound: ``write`` takes ``sound``, samples from the first pose on.
        keyed: it holds keys at uneven times, such as those of a clip's own file.
        check: takes the options and raises where one makes no sense, before any work.
    """

    write: Callable[..., None]
    jointed: bool = False
    single: bool = False
    heard: bool = False
    keyed: bool = False
    check: Callable[..., object] = lambda **_: None


def suffixes() -> list[str]:
    """The endings that :func:`exporter_of` takes, sorted."""
    return sorted(f".{name}" for name in {*_BUILT_IN, *(e.name for e in entry_points(group=ENTRY_POINTS))})


def exporter_of(path: Path | str, also: tuple[str, ...] = (), **options: Any) -> Exporter:
    """Returns the exporter of a file to be made; what could not be written is refused before any work.

    Args:
        also: endings that the caller writes itself, to be named in an error.
        options: that its ``write`` is to take.

    Raises:
        InputError: for an ending without an exporter, or an option that it does not take, or not so.
        ResourceError: where the folder is not there.
    """
    path = Path(path)
    found = _loaded(path.suffix.lower().removeprefix("."), str(path), also)
    known = inspect.signature(found.write).parameters
    for option in options:
        if option not in known:
            what = f"{path.suffix.lower()} has no {option!r} to choose"
            raise InputError(what, where=str(path), mend="Leave it out.")
    need_folder(path)
    found.check(**options)
    return found


def _loaded(name: str, where: str, also: tuple[str, ...]) -> Exporter:
    """The exporter of that name; imported only now, so that a missing library stops no other."""
    if name in _BUILT_IN:
        module, _, attribute = _BUILT_IN[name].partition(":")
        found: Exporter = getattr(import_module(module), attribute)
        return found
    for entry in entry_points(group=ENTRY_POINTS):
        if entry.name == name:
            loaded: Exporter = entry.load()
            return loaded
    what = f".{name} cannot be written" if name else "its name has no ending"
    package = _IN_PACKAGES.get(name)
    known = ", ".join(sorted({*suffixes(), *also}))
    mend = f"Install its package: pip install {package}." if package else f"Known: {known}."
    raise InputError(what, where=where, mend=mend)
