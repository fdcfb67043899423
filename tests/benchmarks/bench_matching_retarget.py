"""Measures playing a retargeted take: microseconds per bone and time, with all layers sampled and all joints
placed.

The peer does the same job like Python add-ons: a loop over frames, over bones, and over their constraints,
with small NumPy arrays. Its results are compared with ours. Takes have 30 frames per second and are played at
60, so that every other time is between two frames.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator

import numpy as np
import plain_constraints
from figure import Figure

from enliven.document.clip import Clip
from enliven.document.project import Project
from enliven.document.rigged import still_shape
from enliven.document.skeleton import Skeleton
from enliven.motion.layers.evaluate import Player
from enliven.motion.layers.retarget import bind_chain, set_travel
from enliven.person.joints import PARENTS
from enliven.rotation import from_rotation_vector, multiply

FRAMES, STEP = 300, 1.0 / 30.0
MOMENTS = 600
ARMS = ((2, 4, 5, 6, 7), (2, 8, 9, 10, 11), (0, 12, 13, 14, 15), (0, 16, 17, 18, 19))


def figures() -> Iterator[Figure]:
    """Yields the time of a whole take at once, as in an export, and of single times, as in a viewer."""
    rng = np.random.default_rng(5)
    project = spider(person(rng), rng)
    player, bones = Player(project, "spider"), len(project.shape("spider").skeleton)
    times = np.arange(MOMENTS) * STEP / 2
    few = times[:20]
    plain = plain_constraints.evaluated(project, "spider", few)
    np.testing.assert_allclose(player.sample(few)[1], plain, atol=1e-9)
    theirs = _least(lambda: plain_constraints.evaluated(project, "spider", few), 5) / (len(few) * bones)
    ours = _least(lambda: player.sample(times), 30) / (len(times) * bones)
    yield Figure("matching.retarget_us_per_bone", ours, "us", "plain NumPy constraints", theirs / ours)
    live = _least(lambda: [player.compute_pose(seconds) for seconds in times[:100]], 30) / (100 * bones)
    yield Figure("matching.retarget_live_us_per_bone", live, "us", "plain NumPy constraints", theirs / live)
    yield Figure("matching.retarget_prepare_ms", _least(lambda: Player(project, "spider"), 30) / 1000, "ms")


def person(rng: np.random.Generator) -> Clip:
    """Returns a clip of a person with 20 joints that moves every bone, for ten seconds."""
    positions = np.zeros((20, 3))
    for joint, parent in enumerate(PARENTS[1:], 1):
        positions[joint] = positions[parent] + rng.normal(size=3) * 0.15
    skeleton = Skeleton(tuple(f"joint {j}" for j in range(20)), np.array(PARENTS, np.int32), positions)
    t = np.arange(FRAMES)[:, None] * STEP
    turns = np.empty((FRAMES, 20, 4))
    for joint, parent in enumerate(PARENTS):
        waves = np.sin(t * rng.uniform(1, 6, 3) + rng.uniform(0, 6, 3)) * rng.uniform(0, 0.6, 3)
        own = from_rotation_vector(waves)
        turns[:, joint] = own if parent < 0 else multiply(turns[:, parent], own)
    return Clip("person", skeleton, turns, positions[0] + 0.3 * np.sin(t) * rng.normal(size=3), STEP)


def spider(take: Clip, rng: np.random.Generator) -> Project:
    """Returns a spider with eight legs of six bones. Each arm or leg of a person moves two of them."""
    parents, places = [-1], [np.array([0.0, 0.5, 0.0])]
    for leg in range(8):
        way = np.array([np.cos(leg * np.pi / 4), -0.2, np.sin(leg * np.pi / 4)])
        for part in range(6):
            parents.append(0 if part == 0 else len(parents) - 1)
            places.append(places[parents[-1]] + 0.2 * way + 0.03 * rng.normal(size=3))
    names = tuple(f"joint {j}" for j in range(len(parents)))
    shape = still_shape("spider", Skeleton(names, np.array(parents, np.int32), np.array(places)))
    project = Project().with_takes(take).with_characters(shape)
    project = bind_chain(project, "spider", (0,), "person", (0,), layer_id="body")
    for leg in range(8):
        chain = (0, *range(1 + 6 * leg, 7 + 6 * leg))
        project = bind_chain(project, "spider", chain, "person", ARMS[leg % 4], offset=-0.1 * leg)
    return set_travel(project, "spider", "body")


def _least(job: Callable[[], object], repeats: int) -> float:
    """Returns the microseconds of the fastest of ``repeats`` runs."""
    job()
    took = []
    for _ in range(repeats):
        start = time.perf_counter()
        job()
        took.append(time.perf_counter() - start)
    return min(took) * 1e6
