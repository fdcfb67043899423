"""Support of glTF extensions: defines which extensions are read, ignored or refused.

notes = extension_notes(document)       # raises for an unsupported required extension
follow_pointers(document)               # converts channels of KHR_animation_pointer to ordinary ones
"""

from __future__ import annotations

import re
from typing import Any

from enliven.errors import InputError
from enliven.meshes.gltf.gltf_json import Entry

DRACO = "KHR_draco_mesh_compression"
"""Vertices and faces compressed by Draco, which are decoded."""
MESHOPT = ("EXT_meshopt_compression", "KHR_meshopt_compression")
"""Buffer views compressed by meshoptimizer, which are decoded."""
INSTANCING = "EXT_mesh_gpu_instancing"
"""Several instances of one mesh, given by a table of transforms."""
VISIBILITY = "KHR_node_visibility"
"""Nodes that are hidden with their whole subtree."""
POINTER = "KHR_animation_pointer"
"""Channels that can animate any value of the file. A JSON pointer refers to the value."""
_SUPPORTED_EXTENSIONS = {
    "KHR_mesh_quantization",
    "KHR_texture_transform",
    "KHR_materials_unlit",
    "VRM",
    "VRMC_vrm",
    DRACO,
    *MESHOPT,
    INSTANCING,
    VISIBILITY,
    POINTER,
}
_PICTURE_EXTENSIONS = {
    "EXT_texture_webp": "images in WebP",
    "EXT_texture_avif": "images in AVIF",
    "KHR_texture_basisu": "images in Basis Universal",
    "MSFT_texture_dds": "images in DDS",
}
_HARMLESS_PATTERN = re.compile(
    r"KHR_materials_\w+|VRMC_materials_\w+|ADOBE_materials_\w+|NV_materials_mdl|EXT_materials_\w+"
    r"|KHR_lights_punctual|EXT_lights_\w+|KHR_texture_\w+|KHR_techniques_webgl|KHR_xmp(_json_ld)?"
    r"|KHR_audio(_\w+)?|MSFT_audio_emitter|KHR_interactivity|KHR_node_(select|hover)ability|GODOT_single_root"
    r"|KHR_physics_rigid_bodies|KHR_implicit_shapes|KHR_collision_shapes|OMI_\w+|EXT_mesh_features"
    r"|EXT_(structural|instance)_\w+|EXT_mesh_manifold|CESIUM_primitive_outline|FB_geometry_metadata"
    r"|AGI_\w+|MSFT_lod|MSFT_packing_\w+|VRMC_springBone\w*|KHR_blend|KHR_accessor_float64"
)
"""Names of extensions that change neither the surface at rest nor the animations of a file."""
_VISIBILITY_POINTER = re.compile(rf"/nodes/(\d+)/extensions/{VISIBILITY}/visible")
"""Pattern of a JSON pointer to the visibility of a node. Its group is the node's number."""
_NODE_POINTER = re.compile(r"/nodes/(\d+)/(translation|rotation|scale|weights)")
"""Pattern of a JSON pointer to a value that an ordinary channel can also animate. Its groups are the node's
number and the value."""


def extension_notes(document: Entry) -> list[str]:
    """Returns a sentence for each ignored extension that affects the result, without duplicates.

    Raises:
        InputError: if the file requires an unsupported extension.
    """
    required, used = _unique_names(document.extensionsRequired), _unique_names(document.extensionsUsed)
    needed = [name for name in required if name not in _SUPPORTED_EXTENSIONS and not _is_harmless(name)]
    if needed:
        advice = "Export the model again without these extensions."
        raise InputError(f"the file requires unsupported glTF extensions: {', '.join(needed)}", remedy=advice)
    notes = list[str]()
    for name in required:
        if _is_harmless(name):
            content = _PICTURE_EXTENSIONS.get(name, "neither shape nor motion")
            notes.append(f"the required glTF extension {name} is ignored: it contains {content}")
    for name in used:
        if name not in required and name not in _SUPPORTED_EXTENSIONS and not _is_harmless(name):
            notes.append(f"the glTF extension {name} is not supported, and its content is ignored")
    return notes


def follow_pointers(document: Entry) -> list[str]:
    """Converts channels that point to a node's position, rotation, scale or weights into ordinary channels.

    Returns a sentence about channels with other targets, which are left out.
    """
    skipped_targets = list[str]()
    for animation in document.animations or []:
        kept_channels = list[Any]()
        for channel in animation.channels or []:
            target = channel.target
            if target is not None and target.path == "pointer":
                pointer = getattr(getattr(target.extensions, POINTER, None), "pointer", None)
                match = _NODE_POINTER.fullmatch(pointer) if isinstance(pointer, str) else None
                if match is None:
                    _show_node(document, pointer)
                    skipped_targets.append(pointer if isinstance(pointer, str) else "nothing")
                    continue
                target.node, target.path = int(match[1]), match[2]
            kept_channels.append(channel)
        animation.channels = kept_channels
    if not skipped_targets:
        return []
    shown = ", ".join(name[:80] for name in list(dict.fromkeys(skipped_targets))[:5])
    return [
        "only animations of the position, rotation and scale of nodes are read. These "
        f"animated values are ignored: {shown}"
    ]


def _show_node(document: Entry, pointer: Any) -> None:
    """Makes a node visible if the animation target ``pointer`` is its visibility, because its surface is then
    needed."""
    match = _VISIBILITY_POINTER.fullmatch(pointer) if isinstance(pointer, str) else None
    if match is not None and int(match[1]) < len(document.nodes):
        node = document.nodes[int(match[1])]
        visibility = getattr(node.extensions, VISIBILITY, None)
        if isinstance(visibility, Entry):
            vars(visibility)["visible"] = True


def find_hidden_nodes(document: Entry, parents: list[int]) -> set[int]:
    """Returns the hidden nodes of a file, with their whole subtrees."""
    visible = [
        getattr(getattr(node.extensions, VISIBILITY, None), "visible", None) for node in document.nodes
    ]
    hidden = set[int]()
    for node in range(len(parents)):
        ancestor = node
        while ancestor >= 0 and visible[ancestor] is not False:
            ancestor = parents[ancestor]
        if ancestor >= 0:
            hidden.add(node)
    return hidden


def _unique_names(listed: Any) -> list[str]:
    """Returns the names in a list of extensions, without duplicates."""
    return list(dict.fromkeys(name for name in listed or [] if isinstance(name, str)))


def _is_harmless(name: str) -> bool:
    return name in _PICTURE_EXTENSIONS or _HARMLESS_PATTERN.fullmatch(name) is not None
