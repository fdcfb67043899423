"""Casting makes an actor on the stage from a rigged model."""

from __future__ import annotations

import logging
from pathlib import Path

from enliven.errors import InputError
from enliven.formats.gltf import read_gltf
from enliven_edge.stage.casting import name_of
from enliven_edge.stage.rig.rig_actor import RigActor
from enliven_edge.stage.rig.settings import MatchingSettings

log = logging.getLogger(__name__)


def cast_rig(spec: str, settings: MatchingSettings | None = None, name: str = "") -> RigActor:
    """Returns the actor of a rigged glTF model, on the floor and scaled to the settings' height.

    Args:
        name: the character's id; empty: the file's stem.

    Raises:
        InputError: for a file that is no glTF, or cannot be used.
    """
    settings = settings or MatchingSettings()
    if Path(spec).suffix.lower() not in (".glb", ".gltf"):
        mend = "Give a rigged .glb or .gltf, or drive the mesh by a graph."
        raise InputError("it has no skeleton of its own", where=spec, mend=mend)
    rig = read_gltf(Path(spec), name=name or name_of(spec), height=settings.height or None, floor=True)
    for note in rig.notes:
        log.info("%s: %s", spec, note)
    return RigActor(rig.shape, settings)
