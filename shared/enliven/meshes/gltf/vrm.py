"""The humanoid map of a VRM avatar, versions 0 and 1: the node of each human bone."""

from __future__ import annotations

from typing import Any

from enliven.meshes.gltf.gltf_json import Entry


def read_human_bones(document: Entry) -> dict[int, str]:
    """Returns the VRM name (such as "leftUpperArm") of each node in the humanoid map, or {} if there is no
    map.

    Damaged entries are left out, because a model without its map is still usable.
    """
    extensions = document.extensions
    listed = _bone_nodes(getattr(extensions, "VRMC_vrm", None)) or _bone_nodes(
        getattr(extensions, "VRM", None)
    )
    count = len(document.nodes) if isinstance(document.nodes, list) else 0
    return {
        node: bone
        for bone, node in listed
        if isinstance(node, int) and 0 <= node < count and isinstance(bone, str) and bone
    }


def _bone_nodes(extension: Any) -> list[tuple[Any, Any]]:
    """Returns the pairs (bone, node) of a humanoid map, which is a list in version 0 and an object in version
    1."""
    bones = getattr(getattr(extension, "humanoid", None), "humanBones", None)
    if isinstance(bones, list):
        return [(entry.bone, entry.node) for entry in bones if isinstance(entry, Entry)]
    if isinstance(bones, Entry):
        return [(bone, getattr(entry, "node", None)) for bone, entry in vars(bones).items()]
    return []
