"""Attaches one shape (the graft) to another (the host) at a time, and keeps the motion of both (AniMesh,
section 6)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from enliven.arrays import Bool, Float, Int
from enliven.document import Layer, Pin, Project, RiggedCharacter, SkinWeights, are_identical, unused
from enliven.errors import InputError
from enliven.meshes import Mesh
from enliven.modeling.mesh.joining import SkinnedSurface, join_surfaces
from enliven.modeling.mesh.meshes import bone_maps, compute_posed_vertices, identity_maps
from enliven.modeling.mesh.seam import SeamSettings, heal_seam
from enliven.modeling.rigged.axes import Axes, convert_mesh_axes
from enliven.modeling.rigged.bones import bone_number, check_fraction, list_bones, rebuild_shape
from enliven.modeling.rigged.graft import graft_bones, root_has_skin
from enliven.modeling.rigged.nodes import insert_node
from enliven.modeling.rigged.posed import pose_with_stretch, with_travel_kept
from enliven.modeling.skinning.skins import renumber_bones
from enliven.motion.layers.evaluate import ShapePose
from enliven.rotation import IDENTITY, conjugate, multiply, normalized

_DEFAULT_SEAM = SeamSettings()
_JOINT_TOLERANCE = 1e-9
"""Maximum distance of a node from the end of a bone, as a fraction of the bone's length, at which the joint
is used instead."""


def merge(
    project: Project,
    host_id: str,
    joint: int | str,
    graft_id: str,
    time: float | None = None,
    *,
    at: float = 1.0,
    loose: bool = False,
    seam: SeamSettings = _DEFAULT_SEAM,
    notes: list[str] | None = None,
) -> tuple[Project, dict[str, str]]:
    """Merges two shapes: joins the root of one shape to a node of the other.

    The graft moves to the node without rotating. At ``time`` every bone of both keeps its world rotation. The
    joints of the graft keep their positions if its root was at the node. Otherwise, the graft is moved to the
    node. From then on the graft follows the bone that ends at the node. Let W be the world rotation of that
    bone at ``time``. The modeling rotation of each bone that starts at the graft's root is multiplied by W^-1
    from the left (AniMesh, section 6, Figure 8). The host moves as before at every time.

    The graft is converted to the host's rest axes. Its rest pose is turned by R = W^-1 D_b(time). So in the
    host's rest pose, skeleton and mesh of the graft look as they do at ``time``. Here b is the graft's first
    bone. It is the root itself in three cases: for a merge in the rest pose, if several bones start at the
    root, or if skin follows the root. A modeling rotation m becomes R m R^-1, and the basis of a layer
    becomes R basis. The rotation of the graft's root is moved to the bones that start at it, as a rotation at
    the joint (a span without length). If skin follows a root that moves, the root stays as a bone without
    length. The graft's travel is dropped, since the host carries it.

    The meshes are united in their poses at ``time``. Near the seam the surface is smoothed and the skin
    weights are recomputed. Elsewhere rest positions and weights stay bit-exact. If the two meshes do not
    touch, they become one mesh of two shells. Vertices that followed the graft's root then follow the bone of
    the node.

    Args:
        joint: a joint of the host, by number or name; or one of its bones, with ``at`` below one.
        time: seconds of the project's time; None merges in the rest pose, as modeled.
        at: position on the host's bone at which a node is inserted first. 1 is its end (the joint), and 0 its
            start. The new node keeps the bone straight at every time, so that the host moves as before.
        loose: if the union fails (a mesh is not a solid), put both shells into one mesh.
        seam: settings for smoothing the seam.
        notes: a list that receives sentences about the union of the meshes.

    Returns:
        The project without the grafted shape, and the new name of each of its joints except the root, which
        becomes the node. A layer of the graft keeps its id unless the host has a different layer with that
        id.

    Raises:
        InputError: if a shape is merged with itself, the joint does not exist, or the union fails and
            ``loose`` is false.
    """
    if host_id == graft_id:
        remedy = "Copy the shape first, and merge it with the copy."
        raise InputError("a shape cannot be merged with itself", where=f"shape {host_id!r}", remedy=remedy)
    graft = project.shape(graft_id)
    j = bone_number(project.shape(host_id), joint)
    if check_fraction(at, f"shape {host_id!r}") <= _JOINT_TOLERANCE:
        j = max(int(project.shape(host_id).skeleton.parents[j]), 0)
    elif at < 1.0 - _JOINT_TOLERANCE:
        project, name = insert_node(project, host_id, j, at, rigid=True)
        j = project.shape(host_id).skeleton.index(name)
    host = project.shape(host_id)
    ours, theirs = pose_with_stretch(project, host, time), pose_with_stretch(project, graft, time)
    world = ours.turns[j]
    axes = Axes(_is_exact_identity(multiply(conjugate(world), theirs.turns[_find_first_bone(graft, time)])))
    layers = _convert_layers(host, graft, axes)
    bones, names = graft_bones(host, j, graft, world, axes, {old: new.id for old, new in layers.items()})
    pins = (*host.pins, *_rename_pins(graft, names))
    changes = {"mesh": None, "skin": None, "pins": pins, "layers": (*host.layers, *layers.values())}
    merged = with_travel_kept(project, host, rebuild_shape(host, [*list_bones(host), *bones], **changes))
    theirs = replace(theirs, joints=theirs.joints + ours.joints[j] - theirs.joints[0])
    surfaces = _make_skinned_surface(host, ours, time), _make_skinned_surface(graft, theirs, time)
    numbers = np.array([merged.skeleton.index(names[name]) for name in graft.skeleton.names])
    moved = _place_graft(surfaces[1], graft, host.skeleton.positions[j], axes, numbers, time)
    merged_pose = None if time is None else pose_with_stretch(project, merged, time)
    mesh, skin = _merge_surface(
        merged, surfaces[0], moved, merged_pose, loose, seam, [] if notes is None else notes
    )
    del names[graft.skeleton.names[0]]
    merged = merged.with_changes(mesh=mesh, skin=skin)
    return project.drop_character(graft_id).with_characters(merged), names


def _convert_layers(host: RiggedCharacter, graft: RiggedCharacter, axes: Axes) -> dict[str, Layer]:
    """Converts the graft's layers to the host's rest axes. Returns them in a dictionary with their old ids as
    keys.

    A layer that equals a layer of the host (as after a cut) is shared with the host.
    """
    host_layers, converted = {layer.id: layer for layer in host.layers}, dict[str, Layer]()
    used_ids = dict.fromkeys([*host_layers, *(layer.id for layer in graft.layers)])
    for layer in graft.layers:
        moved = layer if axes.is_identity else axes.layer(layer)
        if layer.id in host_layers and not are_identical(host_layers[layer.id], moved):
            moved = replace(moved, id=unused(layer.id, used_ids))
            used_ids[moved.id] = None
        converted[layer.id] = moved
    return converted


def _make_skinned_surface(
    shape: RiggedCharacter, pose: ShapePose, time: float | None
) -> SkinnedSurface | None:
    """Returns the skinned mesh: posed at ``time``, or at rest if ``time`` is None."""
    if shape.mesh is None or shape.skin is None:
        return None
    posed = shape.mesh.vertices if time is None else compute_posed_vertices(shape, pose.linear, pose.joints)
    return SkinnedSurface(shape.mesh, shape.skin, posed)


def _place_graft(
    surface: SkinnedSurface | None,
    graft: RiggedCharacter,
    node: Float,
    axes: Axes,
    numbers: Int,
    time: float | None,
) -> SkinnedSurface | None:
    """Converts the graft's rest surface to the host's axes, moves it to the node, and renumbers its bones."""
    if surface is None:
        return None
    mesh = convert_mesh_axes(surface.mesh, graft.skeleton.positions[0], axes, node)
    posed = mesh.vertices if time is None else surface.seen
    return SkinnedSurface(mesh, renumber_bones(surface.skin, numbers), posed)


def _merge_surface(
    merged: RiggedCharacter,
    host: SkinnedSurface | None,
    graft: SkinnedSurface | None,
    merged_pose: ShapePose | None,
    loose: bool,
    seam: SeamSettings,
    notes: list[str],
) -> tuple[Mesh | None, SkinWeights | None]:
    """Returns the mesh and skin of the merged shape. ``merged_pose`` is its pose at the time of the merge, or
    None for a merge in the rest pose."""
    if host is None or graft is None:
        only = host or graft
        return (None, None) if only is None else (only.mesh, only.skin)
    skeleton = (
        merged.skeleton if merged_pose is None else replace(merged.skeleton, positions=merged_pose.joints)
    )
    maps = (
        identity_maps(merged)
        if merged_pose is None
        else bone_maps(merged, merged_pose.linear, merged_pose.joints)
    )

    def heal(mesh: Mesh, skin: SkinWeights, where: Bool) -> tuple[Mesh, SkinWeights]:
        return heal_seam(mesh, skin, skeleton, where, seam)

    return join_surfaces(host, graft, maps, heal, loose=loose, notes=notes, where=f"shape {merged.id!r}")


def _rename_pins(graft: RiggedCharacter, names: dict[str, str]) -> tuple[Pin, ...]:
    """Returns the graft's pins with the new names of its joints."""
    return tuple(replace(pin, joint=names[pin.joint], start=names[pin.start]) for pin in graft.pins)


def _is_exact_identity(turn: Float) -> Float:
    """Returns the rotation (4,), or the exact identity if the two differ only by rounding. So layers stay
    unchanged."""
    turn = normalized(turn)
    return IDENTITY if np.abs(turn[1:]).max() < 1e-13 else turn


def _find_first_bone(graft: RiggedCharacter, time: float | None) -> int:
    """Returns the bone that moves rigidly with the mesh at the root. In the rest pose it is the root."""
    only = graft.skeleton.children[0]
    return only[0] if time is not None and len(only) == 1 and not root_has_skin(graft) else 0
