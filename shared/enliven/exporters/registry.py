"""The registry of exporters: the suffix of a file name selects the exporter.

    exporter_of("out.glb").save(path, performances, "title")

To add an exporter, add a module with an :class:`Exporter`, and one line in this module. Other packages
register exporters as entry points of the group ``enliven.exporters``. The name of the entry point is the
suffix without its dot.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib import import_module
from importlib.metadata import entry_points
from pathlib import Path
from typing import Any

from enliven.errors import InputError, ResourceError
from enliven.exporters.performance import Performance
from enliven.exporters.placement import PLACEMENTS, ExportPlacement
from enliven.exporters.sampling import Representation
from enliven.files import require_folder

ENTRY_POINTS = "enliven.exporters"
"""Entry-point group through which other packages add exporters. An entry point refers to an
:class:`Exporter`."""

_PICTURES = "enliven.pictures"
"""Entry-point group through which other packages provide functions that draw contact sheets."""
BUILT_IN_EXPORTERS = {
    "bvh": "enliven.exporters.bvh:BVH",
    "csv": "enliven.exporters.csv_table:CSV",
    "glb": "enliven.exporters.gltf.write:GLB",
    "html": "enliven.exporters.html_page:HTML",
    "mcap": "enliven.exporters.recording_file:MCAP",
    "obj-sequence": "enliven.exporters.obj_sequence:OBJ_SEQUENCE",
    "usda": "enliven.exporters.usd.write:USD",
    "usdc": "enliven.exporters.usd.write:USD",
    "usdz": "enliven.exporters.usd.write:USD",
    "vrm": "enliven.exporters.vrm.avatar:VRM",
    "vrma": "enliven.exporters.vrm.animation:VRMA",
}
_REFUSALS = {
    "up": "Remove the option. The format always uses the same vertical axis.",
}
"""Advice in error messages about options that a format does not support. The default advice is to leave the
option out."""
_IN_PACKAGES = {"mp4": "enliven-viewer"}
"""Names of the packages with further exporters, by file suffix. They may not be installed."""


@dataclass(frozen=True)
class Exporter:
    """An exporter for one kind of file.

    Attributes:
        write: a function with the parameters path, performances, title, and options as keywords. It writes
            the file completely or not at all. If it has the parameter ``progress``, it calls this function
            with the finished fraction.
        jointed: True if it supports only characters with a skeleton.
        solid: True if it supports only characters with a surface.
        single: True if its files contain only one character.
        heard: True if it supports sound. ``write`` then has the parameter ``sound``: audio samples that start
            at the first pose.
        keyed: True if it supports keys at uneven times, such as the keys of an imported file.
        pointwise: True if it stores the surface of each frame. Then puppets need no baking.
        placements: options of :class:`ExportPlacement` that it supports. A format with a fixed vertical axis
            lacks "up".
        check: a function that takes the options of ``write`` and raises InputError if one is invalid. It is
            called before any work.
    """

    write: Callable[..., None]
    jointed: bool = False
    solid: bool = True
    single: bool = False
    heard: bool = False
    keyed: bool = False
    pointwise: bool = False
    placements: tuple[str, ...] = ("scale", "in_place")
    check: Callable[..., object] = lambda **_: None

    @property
    def options(self) -> frozenset[str]:
        """The names of all options that :meth:`save` accepts."""
        return frozenset((*list(inspect.signature(self.write).parameters)[3:], *self.placements))

    def save(self, path: Path | str, performances: Sequence[Performance], name: str, **options: Any) -> None:
        """Applies the placement options to the performances, and writes the file.

        Args:
            name: the title.
            options: the options of ``write``, and the fields of :class:`ExportPlacement` that the exporter
                supports.

        Raises:
            InputError: if the format cannot represent the data, or an option is invalid.
            ResourceError: if the file cannot be written.
        """
        placement = ExportPlacement(**{key: value for key, value in options.items() if key in PLACEMENTS})
        placed_performances = [placement.apply_to(performance) for performance in performances]
        self.write(Path(path), placed_performances, name, **self.list_own_options(options))

    def representation(self, morphs: bool = False) -> Representation:
        """Returns the form in which the exporter needs the surfaces of puppets.

        Args:
            morphs: True if the caller requests morph targets.
        """
        return "morphs" if morphs else "points" if self.pointwise else "skin"

    def list_own_options(self, options: dict[str, Any]) -> dict[str, Any]:
        """Returns those of the options that ``write`` accepts, without the placement options."""
        parameters = inspect.signature(self.write).parameters
        return {key: value for key, value in options.items() if key in parameters or key not in PLACEMENTS}


def suffixes() -> list[str]:
    """Returns the file suffixes that :func:`exporter_of` accepts, sorted."""
    return sorted(
        f".{name}" for name in {*BUILT_IN_EXPORTERS, *(e.name for e in entry_points(group=ENTRY_POINTS))}
    )


def exporter_of(path: Path | str, also: tuple[str, ...] = (), **options: Any) -> Exporter:
    """Returns the exporter for a file. Unsupported output is refused before any work.

    Args:
        also: suffixes that the caller writes itself. Error messages list them as known suffixes.
        options: options for :meth:`Exporter.save`.

    Raises:
        InputError: if the suffix has no exporter, or an option is unknown or invalid.
        ResourceError: if the folder is missing.
    """
    path = Path(path)
    exporter = _load_exporter(path.suffix.lower().removeprefix("."), str(path), also)
    for option in options:
        if option not in exporter.options:
            problem = (
                f"the format {path.suffix.lower()} does not support the option {option.replace('_', '-')!r}"
            )
            raise InputError(problem, where=str(path), remedy=_REFUSALS.get(option, "Remove the option."))
    require_folder(path)
    ExportPlacement(**{key: value for key, value in options.items() if key in PLACEMENTS})
    exporter.check(**exporter.list_own_options(options))
    return exporter


def _load_exporter(name: str, where: str, also: tuple[str, ...]) -> Exporter:
    """Returns the exporter for the suffix ``name``.

    The exporter is imported only when it is needed, so that a missing library of one exporter does not
    disable the others.
    """
    if name in BUILT_IN_EXPORTERS:
        module, _, attribute = BUILT_IN_EXPORTERS[name].partition(":")
        exporter: Exporter = getattr(import_module(module), attribute)
        return exporter
    for entry in entry_points(group=ENTRY_POINTS):
        if entry.name == name:
            loaded_exporter: Exporter = entry.load()
            return loaded_exporter
    problem = f"the format .{name} cannot be written" if name else "the file name has no suffix"
    package = _IN_PACKAGES.get(name)
    endings = ", ".join(sorted({*suffixes(), *also}))
    remedy = (
        f"Install the package for this format: pip install {package}."
        if package
        else f"Known suffixes: {endings}."
    )
    raise InputError(problem, where=where, remedy=remedy)


def find_sheet_function(kind: str) -> Callable[..., None]:
    """Returns the function that draws contact sheets of a kind, from the package that provides it.

    Args:
        kind: "motion" for a retargeted shape, or "puppet".

    Raises:
        ResourceError: if no installed package provides it.
    """
    for entry in entry_points(group=_PICTURES):
        if entry.name == kind:
            draw_sheet: Callable[..., None] = entry.load()
            return draw_sheet
    raise ResourceError(
        "contact sheets need the package enliven-viewer, which is not installed",
        where="--sheet",
        remedy="Install it: pip install enliven-viewer.",
    )
