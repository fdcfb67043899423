"""The clips that came with a model: which of a project's takes they are, and the one that a shape plays.

own_clips(project, shape)                    # the names of the takes that were made for this very skeleton
clip_to_open(shape, clips)                   # the one that a model plays when it is opened
play_own_clip(project, shape_id, name)       # in the place of the shape's other takes; None stops it
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from enliven.arrays import Float
from enliven.document import Clip, Layer, Project, Shape, Skeleton, joint_places
from enliven.errors import InputError
from enliven.formats.rig import playing

_SAME = 1e-6
"""Share of the size by which joints of one skeleton are apart at most: the rounding of files."""
_STILL = 1e-3
"""Share of the size that joints move by at most in a clip that is a pose, or where a loop is closed."""
_SEAM_FRAMES = 1.5
"""Frames of movement between the last pose and the first of a loop: not all files repeat the frame."""


def is_own_take(clip: Clip, shape: Shape) -> bool:
    """Whether a take was made for this very skeleton: the same joints, in the same places at rest."""
    return _is_same(clip.skeleton, shape.skeleton)


def _is_same(mine: Skeleton, theirs: Skeleton) -> bool:
    """Whether two skeletons have the same joints, in the same places around their roots."""
    if mine is theirs:
        return True
    if mine.names != theirs.names or not np.array_equal(mine.parents, theirs.parents):
        return False
    apart = np.abs((mine.positions - mine.positions[0]) - (theirs.positions - theirs.positions[0])).max()
    return bool(apart < _SAME * float(np.ptp(theirs.positions, axis=0).max()))


def own_clips(project: Project, shape: Shape) -> tuple[str, ...]:
    """The names of the takes that a shape can play joint by joint: those of its own skeleton.

    A shape that plays one may have been turned, moved and scaled since it was opened. Takes that retargeting
    made from another, such as "walk: steps", are not clips of the model.
    """
    played, takes = _joint_layers(project, shape), project.takes
    skeleton = takes[played[0].take].skeleton if played else shape.skeleton
    return tuple(
        name
        for name, take in takes.items()
        if _is_same(take.skeleton, skeleton) and not any(name.startswith(f"{other}: ") for other in takes)
    )


def played_clip(project: Project, shape: Shape) -> str | None:
    """The name of the own clip that moves a shape, apart from keys; None without one."""
    played = _joint_layers(project, shape)
    return played[0].take if played and not played[0].muted else None


def is_looping(clip: Clip) -> bool:
    """Whether a clip ends in the pose in which it began, wherever it went over the ground."""
    places = _poses(clip)
    if len(places) < 2:
        return False
    steps = np.linalg.norm(np.diff(places, axis=0), axis=2).max(1)
    seam = float(np.linalg.norm(places[-1] - places[0], axis=1).max())
    return seam <= max(_STILL * _size(clip), _SEAM_FRAMES * float(np.median(steps)))


def clip_to_open(shape: Shape, clips: Sequence[Clip]) -> Clip | None:
    """The clip that a model plays when it is opened, of those that move; None without one.

    One that is named as idle is taken first, then one that loops.
    """
    moving = [clip for clip in clips if is_own_take(clip, shape) and _is_moving(clip)]
    looping = [clip for clip in moving if is_looping(clip)]
    idle = [clip for clip in looping if "idle" in clip.id.lower()]
    return next(iter((*idle, *looping, *moving)), None)


def play_own_clip(project: Project, shape_id: str, name: str | None) -> Project:
    """A project in which a shape plays one of its own clips in the place of its other takes, or nothing.

    A clip that ends in its first pose begins again at its end. Keys stay, pinned feet are let go.

    Raises:
        InputError: if the take is not there, or was made for another skeleton.
    """
    shape = project.shape(shape_id)
    known, played = own_clips(project, shape), _joint_layers(project, shape)
    if name is not None and name not in known:
        mend = f"Known: {', '.join(known) or 'none'}."
        raise InputError(f"{name!r} is not a clip of {shape_id!r}", where="project", mend=mend)
    if played:
        return _relabelled(project, shape, played, name)
    project = stilled(project, shape_id)
    shape = project.shape(shape_id).with_changes(pins=())
    if name is None:
        return project.with_characters(shape)
    project, _ = playing(project.with_characters(shape), shape, project.takes[name])
    return looped(project, shape_id) if is_looping(project.takes[name]) else project


def _relabelled(project: Project, shape: Shape, played: Sequence[Layer], name: str | None) -> Project:
    """A project in which the layers of a shape that plays a clip play another one, or are muted."""
    others = [layer for layer in shape.layers if layer not in played]
    made = [replace(layer, muted=True) for layer in played]
    if name is not None:
        clip = project.takes[name]
        how = {"take": name, "muted": False, "loop": is_looping(clip), "stretch": bool(clip.tracks)}
        made = [replace(layer.timeless(), **how) for layer in played]
    return project.with_characters(shape.with_changes(layers=(*made, *others)))


def _joint_layers(project: Project, shape: Shape) -> tuple[Layer, ...]:
    """The layers by which a shape plays a clip of its own, joint by joint; none if it does not.

    What was turned as a whole has another one for the way of its root.
    """
    layers = tuple(layer for layer in shape.layers if not project.takes[layer.take].keys)
    parents = shape.skeleton.parents
    chains = {(int(parents[j]), j) if j else (0,) for j in range(len(parents))}
    if {layer.chain for layer in layers} != chains or len({layer.take for layer in layers}) != 1:
        return ()
    theirs = project.takes[layers[0].take].skeleton
    return layers if theirs.names == shape.skeleton.names else ()


def stilled(project: Project, shape_id: str) -> Project:
    """A project in which no take moves a shape, apart from keys."""
    shape = project.shape(shape_id)
    kept = {layer.id for layer in shape.layers if project.takes[layer.take].keys}
    spans = tuple(
        tuple(replace(span, refs=tuple(ref for ref in span.refs if ref.layer in kept)) for span in some)
        for some in shape.spans
    )
    travel = {} if shape.travel in kept else {"travel": None, "travel_scale": None}
    return project.with_characters(shape.with_changes(spans=spans, **travel))


def looped(project: Project, shape_id: str) -> Project:
    """A project in which every take that moves a shape begins again at its end; keys do not."""
    shape = project.shape(shape_id)
    layers = (one if project.takes[one.take].keys else replace(one, loop=True) for one in shape.layers)
    return project.with_characters(shape.with_changes(layers=tuple(layers)))


def _poses(clip: Clip) -> Float:
    """(F, N, 3) metres, the joints over the place on the floor where the root is."""
    return np.asarray(joint_places(clip) - clip.root[:, None] * [1.0, 0.0, 1.0])


def _size(clip: Clip) -> float:
    return float(np.ptp(clip.skeleton.positions, axis=0).max())


def _is_moving(clip: Clip) -> bool:
    """Whether any joint moves more than a file's rounding."""
    places = joint_places(clip)
    return bool(np.ptp(places, axis=0).max() > _STILL * _size(clip))
