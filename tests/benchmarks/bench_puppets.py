"""Measures a puppet on the stage: the shipped cactus (12 control points). The performer waves, walks and
turns.

`puppets.frame_ms` is the edge's whole work for one sensor frame: bones, examples (two samples per frame),
locomotion, blending. Its peer does only the part of the examples. It solves the same windows of frames as one
sparse least-squares system per point, by scipy.sparse's spsolve without bounds. Both results are compared.
`puppets.surface_ms` is a viewer's frame without the drawing: surface and normals.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from bench_examples import STEP, compute_plain_solution
from figure import Figure

from enliven.arrays import Float
from enliven.document.character import Pose
from enliven.examples.mapping import ExampleMap
from enliven.examples.puppet_examples import examples_from_key_poses
from enliven.person.body import Body
from enliven.samples.shipped import cactus_project
from enliven.wire.convert import pose_to_message
from enliven.wire.envelope import pack_stream
from enliven.wire.posecode import PoseCodec
from enliven_edge.stage.puppet.puppet_actor import PuppetActor
from enliven_edge.tracking.body_model import model
from enliven_edge.tracking.body_model.joint_limits import standing_pose
from enliven_edge.tracking.body_model.posture import Posture, rotation
from enliven_viewer.playback.solved_surfaces import SolvedSurfaces
from enliven_viewer.render.normals import make_solved_rows
from enliven_viewer.render.surface import split_creases

FRAMES, RATE = 600, 30.0
REPEATS = 4
"""Number of repetitions of the performance. The fastest time of each frame counts, since other processes
disturb it."""
_OUT = 2
"""Number of frames in a live window that were already published."""


def figures() -> Iterator[Figure]:
    """Yields a frame on the edge, its delay and bytes, and the surface of a viewer's frame."""
    project = cactus_project()
    puppet = project.puppet("cactus")
    runs = []
    for _ in range(REPEATS):
        actor = PuppetActor(project, puppet)
        actor.warm_up()
        runs.append(_perform_puppet(actor))
    poses, bodies_seen, _ = runs[0]
    took = np.min([run[2] for run in runs], axis=0)
    frame = float(np.median(took[30:]))
    mapping = ExampleMap(examples_from_key_poses(project, puppet), puppet.examples)
    samples = actor.settings.rate / RATE
    theirs = samples * _time_peer(
        mapping, bodies_seen, 1.0 / actor.settings.rate, actor.settings.lag + 1 + _OUT
    )
    yield Figure("puppets.frame_ms", 1000 * frame, "ms", "scipy spsolve", theirs / frame)
    yield Figure("puppets.frame_p99_ms", 1000 * float(np.percentile(took[30:], 99)), "ms")
    yield Figure("puppets.delay_ms", 1000 * (actor.settings.lag + 1) / actor.settings.rate, "ms")
    codec = PoseCodec(actor.character)
    messages = [
        pack_stream(pose_to_message(pose, codec, revision=1, sequence=k)) for k, pose in enumerate(poses)
    ]
    yield Figure("puppets.pose_bytes", float(np.median([len(message) for message in messages])), "bytes")
    yield Figure("puppets.surface_ms", 1000 * _time_surface(actor, poses), "ms")


def _perform_puppet(actor: PuppetActor) -> tuple[list[Pose], Float, Float]:
    """Returns the puppet's poses, the performer's poses (F, P, 3) in the form used by the examples, and the
    seconds of each frame.
    """
    poses, seen, took = [], [], []
    for f in range(FRAMES):
        body = _make_performer(f / RATE)
        started = time.perf_counter()
        poses.append(actor.perform([body], round((f + 1) * 1e9 / RATE)))
        took.append(time.perf_counter() - started)
        if f == 1:
            actor.possess(body)
        if actor.holds:
            seen.append(actor.holds[0].pose)
    return poses, np.array(seen), np.array(took)


def _make_performer(seconds: float) -> Body:
    """Returns a performer that waves with both arms, marches and turns."""
    turns = standing_pose(0.3 * seconds)
    for bone, sign, speed in ((model.UPPER_ARM_L, 1.0, 2.0), (model.UPPER_ARM_R, -1.0, 2.7)):
        turns[bone] = rotation(z=sign * (1.3 - 1.3 * np.cos(speed * seconds))) @ turns[bone]
    for thigh, shin, sign in ((model.THIGH_L, model.SHIN_L, 1.0), (model.THIGH_R, model.SHIN_R, -1.0)):
        lift = max(sign * np.sin(5.0 * seconds), 0.0)
        turns[thigh], turns[shin] = rotation(x=-lift) @ turns[thigh], rotation(x=lift) @ turns[shin]
    joints = Posture(np.array([0.0, 1.0, -2.5]), turns, model.lengths_for_height(1.75)).joints()
    joints[:, 1] -= joints[:, 1].min()
    return Body(1, joints, np.ones(20), stature=1.75)


def _time_peer(mapping: ExampleMap, seen: Float, step: float, frames: int) -> float:
    """Returns the peer's seconds for a window of ``frames`` frames."""
    # The peer has another time step. The weight is scaled so that the same bend has the same cost.
    alike = mapping.settings.acceleration * (STEP / step) ** 2
    free = ExampleMap(mapping.examples, replace(mapping.settings, margin=1e6, acceleration=alike))
    windows = [seen[k : k + frames] for k in range(20, 380, 18)]
    took = []
    for window in windows:
        each = []
        for _ in range(REPEATS):
            started = time.perf_counter()
            plain = compute_plain_solution(free, window)
            each.append(time.perf_counter() - started)
        took.append(min(each))
        np.testing.assert_allclose(free.solve(window, STEP), plain, atol=1e-6)
    return float(np.median(took))


def _time_surface(actor: PuppetActor, poses: list[Pose]) -> float:
    """Returns the median seconds of the surface and its normals."""
    character, runs = actor.character, []
    drawn = split_creases(character.vertices, character.faces)
    for _ in range(REPEATS):
        surfaces, took = SolvedSurfaces(wait=True), []
        for pose in poses[40:160]:
            started = time.perf_counter()
            vertices = surfaces.vertices(character, pose)
            assert vertices is not None
            make_solved_rows(vertices, character.faces, drawn)
            took.append(time.perf_counter() - started)
        runs.append(took)
    return float(np.median(np.min(runs, axis=0)[5:]))
