"""Measures two sensors in one space: calibration against the exact answer, and fusion of two real Kinects'
recordings.

The synthetic pair consists of two rendered Kinects v1 that see one walking person, tracked by the tracker.
The real pair is ../shared/data/skeletons/kinect_multitrack. It is left out if the recordings are missing.
"""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from figure import Figure
from fusion_measures import agreement, fuse_streams, jitter_mm

from enliven.frames import BodyFrame
from enliven.person.body import Body
from enliven.space.rigid_transform import angle_between, invert, transform_points
from enliven.space.space_file import Space
from enliven_edge.fusion.calibration.calibration import calibrate
from enliven_edge.fusion.calibration.tracks import Collector, stream_from_frames
from enliven_edge.fusion.live.fuser import Fuser
from enliven_edge.fusion.live.merge import sensor_positions, settings_before_fusion, transform_bodies
from enliven_edge.importing.base import ImportOptions
from enliven_edge.importing.multitrack import MultiTrackReader
from enliven_edge.sensors.base import Sensor
from enliven_edge.tracking.settings import TrackerSettings
from enliven_edge.tracking.tracker import Tracker

TESTS = Path(__file__).parents[1]
sys.path.insert(0, str(TESTS / "edge" / "fusion"))

from two_views import CLOCKS, PLACES, RATE, View, left_from_right_camera, walker  # noqa: E402

DATA = Path(os.environ.get("ENLIVEN_DATA", TESTS.parents[1] / "shared" / "data"))
MULTITRACK = DATA / "skeletons" / "kinect_multitrack"
KINECTS = ("138.251.207.136", "138.251.213.82")
SECONDS = 12.0
NAME = "tracking.multitrack"


def figures() -> Iterator[Figure]:
    """Yields figures of synthetic data, real data, and the cost."""
    yield from _synthetic()
    if MULTITRACK.is_dir():
        for study in (1, 24):
            yield from _measure_real(study)
    yield from _cost()


class _Reel(Sensor):
    """A sensor that renders the frames of a view when they are read."""

    recorded = True

    def __init__(self, view: View) -> None:
        self.name, self._view, self._next = view.name, view, 0

    def read(self, timeout: float | None = None):
        self._next += 1
        return self._view.frame(self._next - 1) if self._next <= SECONDS * RATE else None

    def close(self) -> None:
        self._next = int(SECONDS * RATE)


def _synthetic() -> Iterator[Figure]:
    """Compares the calibration and the fused joints with the ground truth."""
    performer = walker(SECONDS)
    collectors = []
    for seed, name in enumerate(PLACES):
        reel = _Reel(View(name, (performer,), seed=20 + seed))
        collector = Collector(name, reel, Tracker(settings_before_fusion(TrackerSettings())))
        collector.start()
        while not collector.ended:
            time.sleep(0.05)
        collectors.append(collector)
    streams = {c.name: c.stream() for c in collectors}
    start = time.perf_counter()
    calibration = calibrate(list(streams.values()))
    yield Figure(f"{NAME}.calibration_s", time.perf_counter() - start, "s")
    space = calibration.space({c.name: c.level_from_camera for c in collectors})
    pose = invert(space.sensors["left"].camera) @ space.sensors["right"].camera
    true = left_from_right_camera()
    offset = space.sensors["right"].clock_offset_ns - space.sensors["left"].clock_offset_ns
    clock = abs(offset * 1e-6 - 1e3 * (CLOCKS["left"] - CLOCKS["right"]))
    yield Figure(f"{NAME}.calibration_error_mm", 1e3 * float(np.linalg.norm((pose - true)[:3, 3])), "mm")
    yield Figure(f"{NAME}.calibration_error_deg", float(np.degrees(angle_between(pose, true))), "deg")
    yield Figure(f"{NAME}.calibration_clock_ms", clock, "ms")
    frames = {c.name: c.frames_in_level() for c in collectors}
    both = list(fuse_streams(frames, space, Fuser(sensor_positions(space))))
    world = space.sensors["left"].camera @ invert(View("left", ()).world_from_camera)

    def errors(told: list[BodyFrame]) -> np.ndarray:
        return np.array(
            [
                np.linalg.norm(
                    b.joints
                    - transform_points(world, performer.figure(f.time_ns * 1e-9 - CLOCKS["left"]).joints),
                    axis=1,
                )
                for f in told
                for b in f.bodies
            ]
        )

    alone = {name: errors(_move_to_space(frames[name], space, name)) for name in frames}
    best = min(float(e.mean()) for e in alone.values())
    mean, within = float(errors(both).mean()), float((errors(both) < 0.1).mean())
    yield Figure(f"{NAME}.synthetic.mean_error_mm", 1e3 * mean, "mm", "the better sensor alone", best / mean)
    lost = min(float((e >= 0.1).mean()) for e in alone.values())
    yield Figure(
        f"{NAME}.synthetic.within_10cm",
        within,
        "",
        "joints lost by the better alone",
        lost / max(1 - within, 1e-6),
    )


def _move_to_space(frames: list[BodyFrame], space: Space, name: str) -> list[BodyFrame]:
    """Returns one sensor's frames in world coordinates and on the common clock."""
    place = space.sensors[name]
    return [
        BodyFrame(transform_bodies(f.bodies, place.level), f.time_ns + place.clock_offset_ns, name)
        for f in frames
    ]


def _measure_real(study: int) -> Iterator[Figure]:
    """Measures two real Kinects: alignment, identities, jitter."""
    (path,) = MULTITRACK.glob(f"Study_{study}_*.csv")
    reader = MultiTrackReader()
    reader.clock = "Skeleton_Time"
    frames_of = {name: list(reader.read([path], ImportOptions(device=name))) for name in KINECTS}
    calibration = calibrate([stream_from_frames(name, frames) for name, frames in frames_of.items()])
    space = calibration.space()
    both = list(fuse_streams(frames_of, space, Fuser(sensor_positions(space))))
    alone = [_move_to_space(frames_of[name], space, name) for name in KINECTS]
    minutes = (both[-1].time_ns - both[0].time_ns) / 6e10
    fits = [agreement(both, frames) for frames in alone]
    name = f"{NAME}.study_{study}"
    yield Figure(f"{name}.calibration_rms_mm", 1e3 * calibration.pairs[0].quality.rms, "mm")
    yield Figure(f"{name}.swaps_per_minute", sum(changes for _, changes in fits) / minutes, "1/min")
    yield Figure(f"{name}.identities", len({b.id for f in both for b in f.bodies}), "")
    yield Figure(f"{name}.agreement_mm", float(np.mean([distance for distance, _ in fits])), "mm")
    calm, before = jitter_mm(both), float(np.mean([jitter_mm(frames) for frames in alone]))
    yield Figure(f"{name}.jitter_mm", calm, "mm", "one Kinect alone", before / calm)


def _cost() -> Iterator[Figure]:
    """Measures microseconds per fused frame for two sensors that see six people each."""
    person = walker().figure(0.0).joints
    random = np.random.default_rng(0)
    spots = [np.array([x, 0.0, z]) for x in (-1.0, 0.0, 1.0) for z in (0.0, -0.9)]
    fuser = Fuser({"a": np.array([0.0, 1.2, 0.0]), "b": np.array([2.5, 1.2, -2.0])})
    took = []
    for n in range(400):
        now = n * 33_333_333
        reports = [
            [
                Body(i, person + spot + 0.01 * random.normal(size=(20, 3)), np.ones(20))
                for i, spot in enumerate(spots)
            ]
            for _ in fuser.views
        ]
        start = time.perf_counter()
        for view, bodies in zip(fuser.views, reports, strict=True):
            fuser.update(view.name, bodies, now)
        fuser.bodies(now)
        took.append(time.perf_counter() - start)
    yield Figure(f"{NAME}.fusion_us_2x6", 1e6 * float(np.median(took[50:])), "us")
