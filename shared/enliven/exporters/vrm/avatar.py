"""Writes a humanoid model as a VRM 1.0 avatar (.vrm): mesh, materials, skeleton and the map of human bones.

An avatar has no motion, which is written as a separate .vrma file. The avatar stands in the T-pose, as VRM
requires. The mesh and its inverse bind matrices are unchanged, so the skinning does not change. Each joint of
the skeleton is a node. The rest rotations of the nodes put the skeleton into the T-pose.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from enliven.document import Skeleton, SkinWeights
from enliven.errors import InputError
from enliven.exporters.gltf.scene import GltfScene
from enliven.exporters.joints import json_numbers
from enliven.exporters.performance import Performance
from enliven.exporters.registry import Exporter
from enliven.exporters.vrm.humanoid import Humanoid, humanoid_from_skeleton
from enliven.files import write_file
from enliven.rotation import conjugate, multiply, rotate

EXTENSION = "VRMC_vrm"
_LICENCE = "https://vrm.dev/licenses/1.0/"
"""URL of the licence, which the format requires. All permissions have their strictest values by default."""


def write_vrm(
    path: Path | str, performances: Sequence[Performance], name: str = "enliven", author: str = "unknown"
) -> None:
    """Writes one humanoid model as an avatar in the T-pose.

    Args:
        name: name of the avatar.
        author: author of the avatar, which the format requires.

    Raises:
        InputError: if there is not exactly one character, or if it has no mesh, or if it is not a humanoid
            with joints of known names.
        ResourceError: if the file cannot be written.
    """
    if len(performances) != 1:
        problem = f"a VRM file can contain only one character, but {len(performances)} are selected"
        raise InputError(problem, where=str(path), remedy="Choose one with --character NAME.")
    write_file(Path(path), vrm_bytes(performances[0], name, author), "Choose another output file.")


VRM = Exporter(write_vrm, jointed=True, single=True, placements=("scale",))


def vrm_bytes(performance: Performance, name: str = "enliven", author: str = "unknown") -> bytes:
    """Returns the bytes of the file. See :func:`write_vrm`."""
    mesh, skin = performance.surface
    skeleton = performance.skeleton
    humanoid = humanoid_from_skeleton(skeleton, f"character {performance.name!r}")
    assert skeleton is not None
    if len({bone.joint for bone in humanoid.bones.values()}) < len(humanoid.bones):
        problem = "the character is not a humanoid: its spine has no separate joint"
        raise InputError(
            problem, where=f"character {performance.name!r}", remedy="Export a .glb file instead."
        )
    scene, nodes = GltfScene(name), list[int]()
    rotations = _compute_rest_turns(skeleton, humanoid)
    for joint, parent in enumerate(skeleton.parents):
        if joint:
            local, offset = multiply(conjugate(rotations[parent]), rotations[joint]), skeleton.vectors[joint]
        else:
            local, offset = rotations[0], rotate(humanoid.facing, skeleton.positions[0])
        rest_pose = {"translation": json_numbers(offset), "rotation": json_numbers(np.roll(local, -1))}
        parent_node = nodes[parent] if joint else None
        nodes.append(scene.node(parent_node, name=skeleton.names[joint], children=[], **rest_pose))
    # A bone rotates about its upper joint. In an avatar, all bones that begin at a joint rotate together, so
    # one rotation per joint is enough.
    upper = np.maximum(skeleton.parents, 0).astype(np.uint16)
    skin_of_nodes = SkinWeights(upper[skin.indices], skin.weights)
    scene.add_skinned(performance.name, mesh, skin_of_nodes, nodes[0], nodes, skeleton.positions)
    human_bones = {bone_name: {"node": nodes[bone.joint]} for bone_name, bone in humanoid.bones.items()}
    meta = {"name": name, "authors": [author], "licenseUrl": _LICENCE}
    scene.document.extensionsUsed = [EXTENSION]
    scene.document.extensions = {
        EXTENSION: {"specVersion": "1.0", "meta": meta, "humanoid": {"humanBones": human_bones}},
    }
    return scene.bytes()


def _compute_rest_turns(skeleton: Skeleton, humanoid: Humanoid) -> list[np.ndarray]:
    """Returns the rotation (4,) of each joint's node in the world, in the T-pose."""
    of_joint = {bone.joint: humanoid.t_pose[name] for name, bone in humanoid.bones.items()}
    rotations = list[np.ndarray]()
    for joint, parent in enumerate(skeleton.parents):
        inherited = humanoid.facing if parent < 0 else rotations[parent]
        rotations.append(of_joint.get(joint, inherited))
    return rotations
