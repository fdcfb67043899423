"""The bones of a grafted shape in its host: their rest axes, names and rotations."""

from __future__ import annotations

from enliven.arrays import Float
from enliven.document import RiggedCharacter, unused
from enliven.modeling.rigged.axes import Axes
from enliven.modeling.rigged.bones import Bone, list_bones
from enliven.modeling.rigged.nodes import strip_before
from enliven.modeling.rigged.spans import has_motion, join_consecutive_spans, rotation_without_takes
from enliven.modeling.skinning.skins import follows_bone
from enliven.rotation import conjugate, multiply, normalized


def graft_bones(
    host: RiggedCharacter, j: int, graft: RiggedCharacter, world: Float, axes: Axes, layers: dict[str, str]
) -> tuple[list[Bone], dict[str, str]]:
    """Returns the graft's bones, attached to the host's joint j and in the host's rest axes, and the new
    names of the graft's joints.

    The graft's root gets the name of the node. If it remains as a bone without length, it gets an unused
    name.
    """
    bones = list_bones(graft)
    names = _find_unused_joint_names(host, [bone.name for bone in bones])
    root = bones[0]
    # The first rotation is W^-1 m_0 R^-1. W is the world rotation of the parent bone at the time of the merge
    # (``world``), m_0 is the modeling rotation of the graft's root, and R converts to the new axes.
    first = multiply(multiply(conjugate(world), root.modeling), conjugate(axes.turn))
    turn = root._replace(modeling=first, spans=axes.spans(root.spans, layers))
    node = host.skeleton.names[j]
    if has_motion(root.spans) and root_has_skin(graft):
        names[root.name] = unused(root.name, dict.fromkeys([*host.skeleton.names, *names.values()]))
    else:
        names[root.name] = node
    new_bones = []
    for bone in bones[1:]:
        rest = host.skeleton.positions[j] + axes.vectors(bone.rest - root.rest)
        spans = axes.spans(bone.spans, layers)
        modeling = normalized(axes.rotations(bone.modeling))
        new = Bone(names[bone.name], names[bone.parent], rest, modeling, spans)
        new_bones.append(
            _combine_rotation(turn, new) if bone.parent == root.name and names[root.name] == node else new
        )
    if names[root.name] != node:
        at_node = host.skeleton.positions[j]
        new_bones.insert(0, Bone(names[root.name], node, at_node, normalized(first), turn.spans))
    return new_bones, names


def _combine_rotation(root: Bone, bone: Bone) -> Bone:
    """Combines the root's rotation with a child bone's rotation, so that one bone has both: D_b = m_0 a_0 m_b
    a_b.
    """
    if not has_motion(root.spans):
        fixed = multiply(root.modeling, rotation_without_takes(root.spans))
        return bone._replace(modeling=normalized(multiply(fixed, bone.modeling)))
    spans = join_consecutive_spans(root.spans, bone.spans, 0.0, bone.modeling)
    modeling, spans = strip_before(root.modeling, spans)
    return bone._replace(modeling=normalized(modeling), spans=spans)


def _find_unused_joint_names(host: RiggedCharacter, names: list[str]) -> dict[str, str]:
    """Returns an unused name for each joint of the graft except the root, which becomes the node."""
    used_names: dict[str, object] = dict.fromkeys(host.skeleton.names)
    new_names = {}
    for name in names[1:]:
        new_names[name] = unused(name, used_names)
        used_names[new_names[name]] = None
    return new_names


def root_has_skin(shape: RiggedCharacter) -> bool:
    """Returns True if a vertex follows the root's own rotation."""
    return shape.skin is not None and bool(follows_bone(shape.skin, 0).any())
