"""The upgrade steps of project files. Each step converts a project object to the next version."""

from __future__ import annotations

from typing import Any

from enliven.document import ExampleCharacter, GraphCharacter, RigBase, RiggedCharacter, unused

_VERSION_1_MAPS: dict[str, type[RigBase]] = {
    "shapes": RiggedCharacter,
    "graphs": GraphCharacter,
    "puppets": ExampleCharacter,
}
"""The three maps of characters in version 1, and the rig class of each, in the order in which they are
combined."""


def combine_characters(project: dict[str, Any]) -> dict[str, Any]:
    """Upgrades version 1 to 2: combines three maps of characters to one map, and moves layers into their
    shapes.

    Ids were unique only within each map, so a number is appended to a repeated id.
    """
    layers = project.get("layers", {})
    characters: dict[str, Any] = {}
    for name, rig in _VERSION_1_MAPS.items():
        for key, table in project.get(name, {}).items():
            character = {"kind": rig.kind, **table}
            if rig is RiggedCharacter:
                character["layers"] = [layers[layer] for layer in _layer_ids(table) if layer in layers]
            if rig is GraphCharacter:
                character["parts"] = [
                    {"take" if key == "stream" else key: value for key, value in part.items()}
                    for part in table["parts"]
                ]
            new = unused(key, characters)
            characters[new] = {**character, "id": new}
    return {"characters": characters, **{name: project.get(name, {}) for name in ("takes", "streams")}}


def _layer_ids(shape: dict[str, Any]) -> list[str]:
    """Returns the ids of the layers in the spans of a shape, and of its travel layer, without duplicates."""
    layer_ids = [ref["layer"] for spans in shape["spans"] for span in spans for ref in span.get("refs", [])]
    return list(dict.fromkeys([*layer_ids, *([shape["travel"]] if shape.get("travel") else [])]))
