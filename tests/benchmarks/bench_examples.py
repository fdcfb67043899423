"""Measures trajectories from examples: seconds for a whole motion, compared with SciPy's sparse solver on the
same system.

The motion drives 12 control points. It is CMU's "directing traffic" (3,703 frames) if the real recordings
exist (ENLIVEN_DATA), otherwise waves of that length. The peer builds the paper's system (eq. 24), with its
weights as unknowns, in plain Python, and solves it with scipy.sparse's spsolve. Like the paper, it has no
bounds. Ours is therefore timed without bounds as well, and both results are compared. The paper's own figures
are 73 s for 8 examples and 161 s for 12. Travel is measured over 11 meshes and 6 performances: the largest
and the median offset from the performer's scaled path after a minute, and the maximum foot sliding of
walkers.
"""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import scipy.sparse as sparse
from figure import Figure
from scipy.sparse.linalg import spsolve

from enliven.arrays import Float
from enliven.document.example_settings import ExampleSettings
from enliven.examples.live import LiveExamples
from enliven.examples.mapping import ExampleMap
from enliven.examples.performer import extract_performer_clip
from enliven.examples.poses import Examples
from enliven.examples.suggest import SuggestSettings, suggest_poses
from enliven.formats.motion.expmap import read_expmap
from enliven.motion_clips.capture_clip import clip_of_capture

sys.path.append(str(Path(__file__).parent / "examples"))

from example_travel import list_travels

DATA = Path(os.environ.get("ENLIVEN_DATA", Path(__file__).parents[3] / "shared" / "data"))
TRAFFIC = DATA / "cmu_expmap" / "train_directing_traffic_4.txt"
FRAMES, STEP = 3703, 1.0 / 120.0
JOINTS = (
    *("LeftHand", "RightHand", "LeftForeArm", "RightForeArm", "LeftArm", "RightArm"),
    *("Head", "Spine1", "LeftFoot", "RightFoot", "LeftLeg", "RightLeg"),
)


def figures() -> Iterator[Figure]:
    """Yields whole motions with 8 and 12 examples, the growth of time with frames, a live frame, and the
    travel."""
    poses = make_poses()
    for count in (8, 12):
        examples = examples_of(poses, count)
        mapping = ExampleMap(examples)
        ours = _least(lambda m=mapping: m.solve(poses, STEP), 15)
        yield Figure(f"examples.solve_s_{count}", ours, "s")
        free = ExampleMap(examples, ExampleSettings(margin=1e6))
        started = time.perf_counter()
        plain = compute_plain_solution(free, poses)
        theirs = time.perf_counter() - started
        np.testing.assert_allclose(free.solve(poses, STEP), plain, atol=1e-6 * examples.target_size)
        ours = _least(lambda m=free: m.solve(poses, STEP), 15)
        yield Figure(f"examples.unbounded_s_{count}", ours, "s", "scipy spsolve", theirs / ours)
    mapping = ExampleMap(examples_of(poses, 8))
    # The motion is played forwards and backwards, so that it has no jump. Its length is eight seconds to two
    # minutes.
    long = np.concatenate([poses, poses[::-1]] * 2)
    lengths = np.array([1, 2, 4, 8, 16]) * len(poses) // 4
    rounds = [[_time_call(lambda n=n: mapping.solve(long[:n], STEP)) for n in lengths] for _ in range(12)]
    times = np.array(rounds).min(0)
    yield Figure("examples.growth", float(np.polyfit(np.log(lengths), np.log(times), 1)[0]), "exponent")
    live = LiveExamples(mapping, STEP, 6)
    took = [_time_call(lambda pose=pose: live.push(pose)) for pose in poses[:600]]
    yield Figure("examples.live_ms", 1000 * float(np.median(took[10:])), "ms")
    travelled = list(list_travels())
    if travelled:
        offsets = [travel.offset for travel in travelled]
        yield Figure("examples.travel_offset_m", max(offsets), "m")
        yield Figure("examples.travel_offset_m_median", float(np.median(offsets)), "m")
        yield Figure("examples.travel_farthest_m", max(travel.farthest for travel in travelled), "m")
        steps = [
            travel.slide
            for travel in travelled
            if travel.take in ("walks", "strolls") and "*" in travel.pairs
        ]
        yield Figure("examples.walk_slide_cm_s", max(steps), "cm/s")


def make_poses() -> Float:
    """Returns (F, 12, 3) poses, metres."""
    if TRAFFIC.is_file():
        return extract_performer_clip(clip_of_capture(read_expmap(TRAFFIC), "traffic"), JOINTS).poses
    rng = np.random.default_rng(1)
    t = np.arange(FRAMES)[:, None, None] * STEP
    waves = [np.sin(t * rng.uniform(0.5, 6, (12, 3)) + rng.uniform(0, 6, (12, 3))) for _ in range(3)]
    return rng.normal(size=(12, 3)) + 0.15 * sum(waves)


def examples_of(poses: Float, count: int) -> Examples:
    """Returns the suggested key poses, shown by a creature of other proportions."""
    frames = suggest_poses(poses, SuggestSettings(most=count)).frames
    rng = np.random.default_rng(count)
    sources = poses[list(frames)]
    targets = sources * [1.4, 0.6, 1.1] + 0.08 * rng.normal(size=sources.shape)
    return Examples(JOINTS, JOINTS, sources, targets)


def compute_plain_solution(mapping: ExampleMap, poses: Float) -> Float:
    """Returns (F, P, 3) metres. The weights of all frames are one sparse least-squares system per control
    point.
    """
    nodes = mapping.compute_nodes(poses)
    weight = mapping.settings.acceleration / (STEP * mapping.settings.rate) ** 2
    points, frames, most = nodes.right.shape
    places = np.empty((points, frames, 3))
    each = most + 3
    second = sparse.diags([1.0, -2.0, 1.0], [0, 1, 2], shape=(frames - 2, frames))
    bend = weight * sparse.kron(second, sparse.eye(3))
    for p in range(points):
        blocks, maps, right = [], [], np.zeros(frames * each)
        for f in range(frames):
            block = np.zeros((each, each))
            block[:most, :most] = nodes.matrix[p, f]
            block[most:, most:] = np.diag(1.0 / nodes.slack[p, f])
            blocks.append(block)
            maps.append(np.hstack([nodes.reach[p, f].T, np.eye(3)]))
            right[f * each : f * each + most] = nodes.right[p, f]
        to_places = sparse.block_diag(maps, "csc")
        bent = bend @ to_places
        solution = spsolve((sparse.block_diag(blocks, "csc") + bent.T @ bent).tocsc(), right)
        places[p] = (to_places @ solution).reshape(frames, 3)
    return mapping.convert_to_metres(places)


def _least(job: Callable[[], object], repeats: int) -> float:
    """Returns the seconds of the fastest of ``repeats`` runs."""
    job()
    return min(_time_call(job) for _ in range(repeats))


def _time_call(job: Callable[[], object]) -> float:
    started = time.perf_counter()
    job()
    return time.perf_counter() - started
