"""Samples the motion of a project's characters and of clips as performances, at evenly spaced times.

sample_performance(project, "horse", rate=30.0)      # a rigged shape, a possessed mesh or a puppet
performance_of_clip(clip)                        # a take: its skeleton, drawn as sticks
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Literal

import numpy as np

from enliven.arrays import Float
from enliven.document import (
    Clip,
    ExampleCharacter,
    Project,
    RigBase,
    RiggedCharacter,
    Skeleton,
    SkinWeights,
    compute_closing_time,
    joint_places,
)
from enliven.examples.baking.bake import bake_surface
from enliven.examples.baking.frames import SurfaceFrames, evaluate_states
from enliven.examples.baking.maps import stretch_axes
from enliven.examples.baking.morphs import bake_morphs
from enliven.examples.baking.settings import MAX_CACHED_FRAMES_MB, BakeSettings
from enliven.exporters.file_keys import find_file_keys
from enliven.exporters.performance import Performance
from enliven.meshes import Mesh
from enliven.modeling.edits import get_rig_edits, root_motions
from enliven.modeling.puppet.baking import frame_times
from enliven.motion.layers.evaluate import Player
from enliven.rotation import multiply, to_matrix

Representation = Literal["skin", "morphs", "points"]
"""The form of a puppet's surface: transforms with skin weights, morph targets, or exact vertices."""
_BONE_WIDTH_RATIO = 0.08
"""Width of a bone's octahedron as a fraction of its length, as in animation programs."""
_MAX_EQUAL_TIME_S = 1e-4
"""Maximum difference of two times that count as equal, in seconds. It is shorter than the interval between
the two keys of a jump in a glTF file."""
_MAX_KEYED_ROUNDS = 1000
"""Maximum number of repetitions of a looped clip that are sampled at its keys. Later repetitions are sampled
evenly."""


def sample_performance(
    project: Project,
    character: str | RigBase,
    start: float = 0.0,
    end: float | None = None,
    rate: float = 30.0,
    *,
    how: Representation = "skin",
    settings: BakeSettings | None = None,
    keyed: bool = False,
) -> Performance:
    """Samples a character of a project from ``start`` to ``end`` seconds, at ``rate`` frames per second.

    Args:
        character: a rigged shape, a possessed mesh or a puppet of the project, or the id of one.
        end: end time in seconds. If None, it is the end of the character's last layer. Loops repeat until all
            characters of the project have ended, and then finish the current repetition.
        how: form of a puppet's surface: "skin" bakes it to transforms with skin weights, and "morphs" to
            morph targets. "points" keeps the solved surfaces without baking.
        settings: accuracy of baking a puppet.
        keyed: True to sample also at the key times of imported clips, so that no jump becomes a ramp. If the
            character has no other motion, the cubic keys of the clips are kept instead of sampled frames.

    Raises:
        InputError: if the character does not exist, lacks data that it needs to move, or the times are
            invalid.
    """
    rig = project.character(character) if isinstance(character, str) else character
    if end is None:
        end, rate = _find_loop_end_and_rate(project, rig, start, rate)
    times = frame_times(start, end, rate, rig.id)
    keyed_shape = rig if keyed and isinstance(rig, RiggedCharacter) else None
    if keyed_shape is not None:
        times = _add_key_times(project, keyed_shape, times)
    performance = _SAMPLER_BY_RIG.get(rig.kind, _sample_graph)(
        project, rig, times, how, settings or BakeSettings()
    )
    if keyed_shape is not None:
        performance = replace(performance, cubic=find_file_keys(project, keyed_shape, performance, start))
    return performance


def _find_loop_end_and_rate(
    project: Project, character: RigBase, start: float, rate: float
) -> tuple[float, float]:
    """Returns the time in seconds at which a character has played all layers, and a sampling rate (Hz) at
    which a frame is exactly at a loop's end."""
    active_layers = [layer for layer in character.playing if not layer.muted]
    rounds = [layer.compute_loop_duration(project.length_of(layer)) for layer in active_layers if layer.loop]
    end = project.end_of(character)
    if not rounds:
        return end, rate
    min_end = max(project.end_of(other_character) for other_character in project.characters.values())
    end = compute_closing_time(rounds, min_end)
    return end, (max(round((end - start) * rate), 1) / (end - start) if end > start else rate)


def _add_key_times(project: Project, character: RiggedCharacter, times: Float) -> Float:
    """Returns (T,) even times in seconds, plus the times at which keys of a character's clips are played.

    Evenly spaced times very close to a key are left out, so that a jump is sampled at exactly two times.
    """
    key_times = list[Float]()
    for layer in (*character.layers, *character.root_layers):
        clip = project.takes.get(layer.take)
        if not isinstance(clip, Clip) or clip.fine is None:
            continue
        seconds, duration = clip.fine.seconds, layer.compute_loop_duration(clip.duration)
        for segment in layer.clips(clip.duration):
            moments = segment.begin + (seconds - segment.first) / segment.speed
            moments = moments[(moments >= segment.begin) & (moments <= segment.end)]
            rounds = int((times[-1] - layer.offset) / duration) + 1 if layer.loop and duration > 0.0 else 1
            key_times += [moments + number * duration for number in range(min(rounds, _MAX_KEYED_ROUNDS))]
    keys = np.unique(np.concatenate([np.zeros(0), *key_times]))
    keys = keys[(keys > times[0]) & (keys < times[-1])]
    keys = keys[np.diff(keys, prepend=-np.inf) > _MAX_EQUAL_TIME_S]
    if not len(keys):
        return times
    after = np.clip(np.searchsorted(keys, times), 1, max(len(keys) - 1, 1))
    gap = np.minimum(np.abs(times - keys[after - 1]), np.abs(times - keys[np.minimum(after, len(keys) - 1)]))
    is_free = gap > _MAX_EQUAL_TIME_S
    is_free[[0, -1]] = True
    return np.union1d(times[is_free], keys)


def performance_of_clip(clip: Clip) -> Performance:
    """Returns a clip as a performance of all its frames. Its mesh has a stick for each bone."""
    times: Float = np.arange(len(clip.turns), dtype=np.float64) * clip.step
    skeleton = clip.skeleton
    linear = to_matrix(clip.turns)
    linear = linear if clip.stretch is None else linear @ clip.stretch
    return _performance_from_maps(
        clip.id, skeleton, times, linear, joint_places(clip), *make_octahedral_bone_mesh(skeleton)
    )


def _performance_from_maps(
    name: str,
    skeleton: Skeleton,
    times: Float,
    linear: Float,
    joints: Float,
    mesh: Mesh | None,
    skin: SkinWeights | None,
) -> Performance:
    """Returns the performance of a skeleton from linear maps (T, N, 3, 3) and joint positions (T, N, 3) in
    the world."""
    above = np.maximum(skeleton.parents, 0)
    parent_frame = (skeleton.positions[above], linear, joints[:, above])
    return Performance(name, times - times[0], *parent_frame, mesh, skin, skeleton=skeleton, joints=joints)


def _sample_shape(project: Project, shape: RiggedCharacter, times: Float, *_: object) -> Performance:
    player = Player(project, shape.id)
    turns, joints = player.sample(times)
    linear = player.compute_linear_maps(times, turns)
    if shape.root_layers:
        root_motion = root_motions(project, shape, times)
        linear, joints = to_matrix(root_motion.turn)[:, None] @ linear, root_motion(joints)
    return _performance_from_maps(shape.id, shape.skeleton, times, linear, joints, shape.mesh, shape.skin)


def _sample_graph(project: Project, character: RigBase, times: Float, *_: object) -> Performance:
    """Returns the performance of any rig, as nodes with skin weights."""
    even_times = times if len(times) > 1 else np.append(times, times[0] + 1.0)
    graph, stream = get_rig_edits(character).convert_to_graph_shape(
        project, character, even_times, character.id
    )[:2]
    linear, positions = stream.linear[: len(times)], stream.positions[: len(times)]
    axes = stretch_axes(linear)
    return Performance(
        graph.id, times - times[0], graph.positions, linear, positions, graph.mesh, graph.skin, axes=axes
    )


def _sample_puppet(
    project: Project, puppet: ExampleCharacter, times: Float, how: str, settings: BakeSettings
) -> Performance:
    """Returns the performance of a puppet, baked in its own frame."""
    states, rotations, places = evaluate_states(project, puppet, times)
    if puppet.root_layers:
        root_motion = root_motions(project, puppet, times)
        rotations, places = multiply(root_motion.turn, rotations), root_motion(places[:, None])[:, 0]
    frames, mesh = SurfaceFrames(puppet, states, MAX_CACHED_FRAMES_MB), puppet.mesh
    if how == "skin":
        handles = [point.vertex for point in puppet.points]
        baked = bake_surface(mesh, frames, states, handles, settings)
        linear, positions, error = baked.linear, baked.places, baked.error
        performance = Performance(
            puppet.id, times - times[0], baked.pivots, linear, positions, mesh, baked.skin, axes=baked.axes
        )
    else:
        # All vertices follow a single static transform, because the motion is in the morph targets or the
        # solved surfaces.
        zeros = np.zeros((len(times), 1, 3))
        weights = np.tile(np.array([1, 0, 0, 0], np.float32), (len(mesh.vertices), 1))
        skin = SkinWeights(np.zeros(weights.shape, np.uint16), weights)
        linear = np.tile(np.eye(3), (len(times), 1, 1, 1))
        performance = Performance(puppet.id, times - times[0], zeros[0], linear, zeros, mesh, skin)
        if how == "points":
            return replace(performance, solved=frames, turns=rotations, places=places)
        morphs = bake_morphs(mesh, frames, states, settings)
        performance, error = replace(performance, morphs=morphs), morphs.error
    return replace(performance, turns=rotations, places=places, error=error, keys=settings.keys * error.size)


_SAMPLER_BY_RIG: dict[str, Callable[..., Performance]] = {
    RiggedCharacter.kind: _sample_shape,
    ExampleCharacter.kind: _sample_puppet,
}
"""Sampling functions by kind of rig, for rigs that also export a skeleton or morph targets. Other rigs use
:func:`_sample_graph`."""


def make_octahedral_bone_mesh(skeleton: Skeleton) -> tuple[Mesh | None, SkinWeights | None]:
    """Returns a mesh with an octahedron for each bone, and its skin weights. Returns None if no bone has a
    length."""
    bones = np.flatnonzero(skeleton.lengths > 0)
    if not len(bones):
        return None, None
    bone_vectors, length = skeleton.vectors[bones], skeleton.lengths[bones, None]
    side = np.cross(
        bone_vectors, np.where(np.abs(bone_vectors[:, 1:2]) < 0.9 * length, [0.0, 1.0, 0.0], [1.0, 0.0, 0.0])
    )
    side *= _BONE_WIDTH_RATIO * length / np.linalg.norm(side, axis=1, keepdims=True)
    binormal = np.cross(bone_vectors / length, side)
    begin_points = skeleton.positions[skeleton.parents[bones]]
    waist = begin_points + 0.2 * bone_vectors
    corners = [
        begin_points,
        waist + side,
        waist + binormal,
        waist - side,
        waist - binormal,
        begin_points + bone_vectors,
    ]
    ring = np.array([[0, 2, 1], [0, 3, 2], [0, 4, 3], [0, 1, 4], [5, 1, 2], [5, 2, 3], [5, 3, 4], [5, 4, 1]])
    faces = (ring + 6 * np.arange(len(bones))[:, None, None]).reshape(-1, 3)
    indices = np.zeros((6 * len(bones), 4), np.uint16)
    indices[:, 0] = np.repeat(bones, 6)
    weights = np.tile(np.array([1, 0, 0, 0], np.float32), (len(indices), 1))
    return Mesh(np.stack(corners, 1).reshape(-1, 3), faces.astype(np.int32)), SkinWeights(indices, weights)
