"""Casting makes an actor on the stage from a mesh file or from a mesh that ships."""

from __future__ import annotations

import logging
import re
from pathlib import Path
from typing import Literal

from enliven.deformation.graph import DeformationGraph, character_from, graph_of
from enliven.meshes import Mesh
from enliven.possession import ActorSettings, EmbeddedActor, prepared
from enliven.samples import load_sample

log = logging.getLogger(__name__)

MADE: tuple[Literal["chair", "lamp"], ...] = ("chair", "lamp")
"""The meshes that ship, by name instead of by path."""
_OWN_PARTS = {"lamp": "hip and right arm"}
"""The parts of the body that a shipped mesh is made to be held with; others are held with all."""


def cast(
    spec: str, nodes: int = 128, settings: ActorSettings | None = None, up: str = "y", name: str = ""
) -> EmbeddedActor:
    """The actor of a mesh file, or of a mesh that ships.

    A mesh that meets its performer is scaled to a person's height, moved to where a standing person fits into
    it, and refined where its triangles are too large to bend; one that stays fixed is taken as modelled, in
    metres.

    Args:
        spec: a path, or a name of :data:`MADE`.
        nodes: of the deformation graph.
        up: "x", "y" or "z", the mesh's own axis that points up.
        name: the character's id; empty: the file's stem.

    Raises:
        InputError: for a mesh that cannot be used.
    """
    settings = settings or ActorSettings()
    mesh, size = _prepared(spec, settings, up)
    character = character_from(mesh, DeformationGraph.build(mesh, nodes=nodes), name or name_of(spec))
    return EmbeddedActor(character, graph_of(character), settings, size)


def parts_for(spec: str) -> str:
    """Returns the parts of the body that hold a mesh where the user names none."""
    return _OWN_PARTS.get(spec, "all")


def name_of(spec: str) -> str:
    """A short id for a character: the file's stem, of letters, digits, '-' and '_'."""
    return re.sub(r"[^A-Za-z0-9_-]+", "-", Path(spec).stem)[:40].strip("-") or "mesh"


def _prepared(spec: str, settings: ActorSettings, up: str) -> tuple[Mesh, float]:
    """Returns the mesh as it goes on stage, and how many metres of the file are one metre of it.

    Repairs are logged.
    """
    for name in MADE:
        if spec == name:
            return load_sample(name), 1.0
    from enliven.meshes import load_mesh

    mesh, notes = load_mesh(spec)
    for note in notes:
        log.info("%s: %s", spec, note)
    return prepared(mesh, settings, up)  # type: ignore[arg-type]
