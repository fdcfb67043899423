"""Finds the clips of a model's own file among a project's takes, and plays one of them on a shape.

list_own_clips(project, shape)                    # the names of the takes that have the shape's own skeleton
clip_to_open(shape, clips)                   # the clip that a model plays when it is opened
play_own_clip(project, shape_id, name)       # plays a clip instead of other takes; None stops it
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from enliven.arrays import Float
from enliven.document import Clip, Layer, Project, RiggedCharacter, Skeleton, joint_places
from enliven.errors import InputError
from enliven.formats.rig.rig import play_clip

_MAX_JOINT_DIFFERENCE = 1e-6
"""Maximum distance between corresponding joints of identical skeletons, as a fraction of the size. It allows
for rounding in files."""
_MAX_STILL_MOTION = 1e-3
"""Maximum motion of the joints in a still pose, and maximum distance between the last and the first pose of a
loop, as a fraction of the size."""
_SEAM_FRAMES = 1.5
"""Maximum step from the last pose of a loop to its first pose, relative to the median step between frames. It
is above 1, because not all files repeat the first frame at the end."""


def is_own_take(clip: Clip, shape: RiggedCharacter) -> bool:
    """Returns True if a take has the shape's own skeleton: the same joints at the same rest positions."""
    return _is_same(clip.skeleton, shape.skeleton)


def _is_same(first: Skeleton, second: Skeleton) -> bool:
    """Returns True if two skeletons have the same joints at the same positions relative to their roots."""
    if first is second:
        return True
    if first.names != second.names or not np.array_equal(first.parents, second.parents):
        return False
    offset = np.abs((first.positions - first.positions[0]) - (second.positions - second.positions[0])).max()
    return bool(offset < _MAX_JOINT_DIFFERENCE * float(np.ptp(second.positions, axis=0).max()))


def list_own_clips(project: Project, shape: RiggedCharacter) -> tuple[str, ...]:
    """Returns the names of the takes that were recorded on a shape's own skeleton.

    These takes can be played joint by joint, without retargeting. This also works if the shape has been
    rotated, moved or scaled since it was opened. Takes that retargeting derived from another take, such as
    "walk: steps", are excluded.
    """
    joint_layers, takes = _joint_layers(project, shape), project.takes
    skeleton = takes[joint_layers[0].take].skeleton if joint_layers else shape.skeleton
    return tuple(
        name
        for name, take in takes.items()
        if _is_same(take.skeleton, skeleton)
        and not any(name.startswith(f"{base_name}: ") for base_name in takes)
    )


def find_played_clip(project: Project, shape: RiggedCharacter) -> str | None:
    """Returns the name of the model's own clip that the shape plays, or None. Keys are ignored."""
    joint_layers = _joint_layers(project, shape)
    return joint_layers[0].take if joint_layers and not joint_layers[0].muted else None


def is_looping(clip: Clip) -> bool:
    """Returns True if a clip ends in its first pose, so that it can loop. Travel over the ground is
    ignored."""
    poses = _compute_relative_poses(clip)
    if len(poses) < 2:
        return False
    steps = np.linalg.norm(np.diff(poses, axis=0), axis=2).max(1)
    seam = float(np.linalg.norm(poses[-1] - poses[0], axis=1).max())
    return seam <= max(_MAX_STILL_MOTION * _clip_size(clip), _SEAM_FRAMES * float(np.median(steps)))


def clip_to_open(shape: RiggedCharacter, clips: Sequence[Clip]) -> Clip | None:
    """Returns the clip that a model plays when it is opened, or None if no clip moves.

    A looping clip with "idle" in its name is preferred, then any looping clip, then any moving clip.
    """
    moving = [clip for clip in clips if is_own_take(clip, shape) and _is_moving(clip)]
    looping = [clip for clip in moving if is_looping(clip)]
    idle = [clip for clip in looping if "idle" in clip.id.lower()]
    return next(iter((*idle, *looping, *moving)), None)


def play_own_clip(project: Project, shape_id: str, name: str | None) -> Project:
    """Returns a project in which a shape plays one of its own clips, or none, instead of its other takes.

    A clip that ends in its first pose loops. Keyframes are kept, and foot locks are removed.

    Raises:
        InputError: if the take does not exist, or has another skeleton.
    """
    shape = project.shape(shape_id)
    clips, joint_layers = list_own_clips(project, shape), _joint_layers(project, shape)
    if name is not None and name not in clips:
        remedy = f"Known clips: {', '.join(clips) or 'none'}."
        raise InputError(f"{name!r} is not a clip of {shape_id!r}", where="project", remedy=remedy)
    if joint_layers:
        return _replace_clip(project, shape, joint_layers, name)
    project = mute_takes(project, shape_id)
    shape = project.shape(shape_id).with_changes(pins=())
    if name is None:
        return project.with_characters(shape)
    project, _ = play_clip(project.with_characters(shape), shape, project.takes[name])
    return loop_takes(project, shape_id) if is_looping(project.takes[name]) else project


def _replace_clip(
    project: Project, shape: RiggedCharacter, joint_layers: Sequence[Layer], name: str | None
) -> Project:
    """Returns a project in which the layers of a shape's own clip play the clip ``name`` instead, or are
    muted if ``name`` is None."""
    other_layers = [layer for layer in shape.layers if layer not in joint_layers]
    new_layers = [replace(layer, muted=True) for layer in joint_layers]
    if name is not None:
        clip = project.takes[name]
        changes = {"take": name, "muted": False, "loop": is_looping(clip), "stretch": bool(clip.tracks)}
        new_layers = [replace(layer.with_default_timing(), **changes) for layer in joint_layers]
    return project.with_characters(shape.with_changes(layers=(*new_layers, *other_layers)))


def _joint_layers(project: Project, shape: RiggedCharacter) -> tuple[Layer, ...]:
    """Returns the layers that play a shape's own clip joint by joint, or none if it plays no clip of its own.

    If the shape was rotated as a whole, an additional layer plays the path of its root.
    """
    layers = tuple(layer for layer in shape.layers if not project.takes[layer.take].keys)
    parents = shape.skeleton.parents
    chains = {(int(parents[j]), j) if j else (0,) for j in range(len(parents))}
    if {layer.chain for layer in layers} != chains or len({layer.take for layer in layers}) != 1:
        return ()
    skeleton = project.takes[layers[0].take].skeleton
    return layers if skeleton.names == shape.skeleton.names else ()


def mute_takes(project: Project, shape_id: str) -> Project:
    """Returns a project in which no take moves a shape. Keys are kept."""
    shape = project.shape(shape_id)
    key_layers = {layer.id for layer in shape.layers if project.takes[layer.take].keys}
    spans = tuple(
        tuple(
            replace(span, refs=tuple(ref for ref in span.refs if ref.layer in key_layers))
            for span in bone_spans
        )
        for bone_spans in shape.spans
    )
    travel = {} if shape.travel in key_layers else {"travel": None, "travel_scale": None}
    return project.with_characters(shape.with_changes(spans=spans, **travel))


def loop_takes(project: Project, shape_id: str) -> Project:
    """Returns a project in which every take that moves a shape loops. Keys do not loop."""
    shape = project.shape(shape_id)
    layers = (
        layer if project.takes[layer.take].keys else replace(layer, loop=True) for layer in shape.layers
    )
    return project.with_characters(shape.with_changes(layers=tuple(layers)))


def _compute_relative_poses(clip: Clip) -> Float:
    """Returns joint positions (F, N, 3) in metres relative to the point on the floor below the root."""
    return np.asarray(joint_places(clip) - clip.root[:, None] * [1.0, 0.0, 1.0])


def _clip_size(clip: Clip) -> float:
    return float(np.ptp(clip.skeleton.positions, axis=0).max())


def _is_moving(clip: Clip) -> bool:
    """Returns True if any joint moves by more than rounding errors."""
    places = joint_places(clip)
    return bool(np.ptp(places, axis=0).max() > _MAX_STILL_MOTION * _clip_size(clip))
