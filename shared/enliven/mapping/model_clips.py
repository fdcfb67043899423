"""The clips in a model's own file: finds them among a project's takes, and plays one on a shape.

own_clips(project, shape)                    # the names of the takes that have the shape's own skeleton
clip_to_open(shape, clips)                   # the clip that a model plays when it is opened
play_own_clip(project, shape_id, name)       # replaces the shape's other takes; None stops playback
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from enliven.arrays import Float
from enliven.document import Clip, Layer, Project, Shape, Skeleton, joint_places
from enliven.errors import InputError
from enliven.formats.rig import play_clip

_MAX_JOINT_DIFFERENCE = 1e-6
"""Maximum distance of equal joints in identical skeletons, as a fraction of the size: rounding of files."""
_MAX_STILL_MOTION = 1e-3
"""Maximum motion of joints in a clip that counts as a still pose, and at the seam of a loop, as a fraction of
the size."""
_SEAM_FRAMES = 1.5
"""Maximum step from the last pose of a loop to its first, in median frame steps. Not all files repeat the
first frame at the end."""


def is_own_take(clip: Clip, shape: Shape) -> bool:
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


def own_clips(project: Project, shape: Shape) -> tuple[str, ...]:
    """Returns the names of the takes that were recorded on a shape's own skeleton.

    They can be played joint by joint, without retargeting.

    They still count if the shape has been rotated, moved or scaled since it was opened. Takes that
    retargeting derived from another take, such as "walk: steps", are left out.
    """
    played, takes = _joint_layers(project, shape), project.takes
    skeleton = takes[played[0].take].skeleton if played else shape.skeleton
    return tuple(
        name
        for name, take in takes.items()
        if _is_same(take.skeleton, skeleton) and not any(name.startswith(f"{other}: ") for other in takes)
    )


def played_clip(project: Project, shape: Shape) -> str | None:
    """Returns the name of the model's own clip that the shape plays, or None. Keys are ignored."""
    played = _joint_layers(project, shape)
    return played[0].take if played and not played[0].muted else None


def is_looping(clip: Clip) -> bool:
    """Returns True if a clip ends in its first pose. Travel over the ground is ignored."""
    places = _relative_poses(clip)
    if len(places) < 2:
        return False
    steps = np.linalg.norm(np.diff(places, axis=0), axis=2).max(1)
    seam = float(np.linalg.norm(places[-1] - places[0], axis=1).max())
    return seam <= max(_MAX_STILL_MOTION * _clip_size(clip), _SEAM_FRAMES * float(np.median(steps)))


def clip_to_open(shape: Shape, clips: Sequence[Clip]) -> Clip | None:
    """Returns the clip that a model plays when it is opened, or None if no clip moves.

    A looping clip with "idle" in its name is preferred, then any looping clip, then any moving clip.
    """
    moving = [clip for clip in clips if is_own_take(clip, shape) and _is_moving(clip)]
    looping = [clip for clip in moving if is_looping(clip)]
    idle = [clip for clip in looping if "idle" in clip.id.lower()]
    return next(iter((*idle, *looping, *moving)), None)


def play_own_clip(project: Project, shape_id: str, name: str | None) -> Project:
    """Returns a project in which a shape plays one of its own clips instead of its other takes, or none.

    A clip that ends in its first pose loops. Keys are kept, and pins of feet are removed.

    Raises:
        InputError: if the take does not exist, or has another skeleton.
    """
    shape = project.shape(shape_id)
    clips, played = own_clips(project, shape), _joint_layers(project, shape)
    if name is not None and name not in clips:
        mend = f"Known: {', '.join(clips) or 'none'}."
        raise InputError(f"{name!r} is not a clip of {shape_id!r}", where="project", mend=mend)
    if played:
        return _replace_clip(project, shape, played, name)
    project = mute_takes(project, shape_id)
    shape = project.shape(shape_id).with_changes(pins=())
    if name is None:
        return project.with_characters(shape)
    project, _ = play_clip(project.with_characters(shape), shape, project.takes[name])
    return loop_takes(project, shape_id) if is_looping(project.takes[name]) else project


def _replace_clip(project: Project, shape: Shape, played: Sequence[Layer], name: str | None) -> Project:
    """Returns a project in which the layers that play a shape's own clip play another one, or are muted."""
    others = [layer for layer in shape.layers if layer not in played]
    new_layers = [replace(layer, muted=True) for layer in played]
    if name is not None:
        clip = project.takes[name]
        how = {"take": name, "muted": False, "loop": is_looping(clip), "stretch": bool(clip.tracks)}
        new_layers = [replace(layer.timeless(), **how) for layer in played]
    return project.with_characters(shape.with_changes(layers=(*new_layers, *others)))


def _joint_layers(project: Project, shape: Shape) -> tuple[Layer, ...]:
    """Returns the layers that play a shape's own clip joint by joint; empty if it plays none.

    If the shape was rotated as a whole, one more of them plays the path of its root.
    """
    layers = tuple(layer for layer in shape.layers if not project.takes[layer.take].keys)
    parents = shape.skeleton.parents
    chains = {(int(parents[j]), j) if j else (0,) for j in range(len(parents))}
    if {layer.chain for layer in layers} != chains or len({layer.take for layer in layers}) != 1:
        return ()
    theirs = project.takes[layers[0].take].skeleton
    return layers if theirs.names == shape.skeleton.names else ()


def mute_takes(project: Project, shape_id: str) -> Project:
    """Returns a project in which no take moves a shape. Keys are kept."""
    shape = project.shape(shape_id)
    key_layers = {layer.id for layer in shape.layers if project.takes[layer.take].keys}
    spans = tuple(
        tuple(replace(span, refs=tuple(ref for ref in span.refs if ref.layer in key_layers)) for span in some)
        for some in shape.spans
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


def _relative_poses(clip: Clip) -> Float:
    """Returns joint positions (F, N, 3) in metres relative to the point on the floor below the root."""
    return np.asarray(joint_places(clip) - clip.root[:, None] * [1.0, 0.0, 1.0])


def _clip_size(clip: Clip) -> float:
    return float(np.ptp(clip.skeleton.positions, axis=0).max())


def _is_moving(clip: Clip) -> bool:
    """Returns True if any joint moves by more than the rounding of files."""
    places = joint_places(clip)
    return bool(np.ptp(places, axis=0).max() > _MAX_STILL_MOTION * _clip_size(clip))
