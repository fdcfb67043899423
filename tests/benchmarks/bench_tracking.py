"""Measures the tracker: accuracy, jitter, recovery time, speed.

Accuracy refers to the held-out sequences of :mod:`tracking_set`, on which nothing was tuned. Prefixes name
other sets: "tracking.tuning." the tuning sequences, "tracking.close." limbs close to the trunk,
"tracking.turns." turns and floor work for tuning, and "tracking.floor." newer films in which people do not
sink into the floor. "tracking.sealed.", "tracking.turns_sealed.", "tracking.floor_sealed.",
"tracking.december_sealed." and "tracking.confidence_sealed." are films that were used only once, after all
tuning (:mod:`tracking_kept`). In "tracking.sealed.", the floor is measured as well. Real sequences are
explained in :mod:`tracking_real`. Those of kinect_multitrack are joints without depth, and belong to the
fusion of sensors.
"""

from __future__ import annotations

import os
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import tracking_real
from figure import Figure
from tracking_cache import rendered
from tracking_evaluation import evaluated, mean_recovery
from tracking_kept import SEALED, SEALED_CONFIDENCE, SEALED_DECEMBER, SEALED_FLOOR, SEALED_TURNS
from tracking_scene import DATA
from tracking_scores import Scores, joint_label
from tracking_set import CLOSE, FLOOR, HELD_OUT, TUNING, TURNS, sequences

from enliven.camera import world_from_level_camera
from enliven_edge.tracking.tracker import Tracker
from enliven_edge.warmup import warm_up_tracking

_TAKEN_UP = 20
"""Number of frames before speed is measured. Detecting people costs more than tracking them."""
_SETTLED = 30
"""Number of frames (one second) before a frame with one performer is timed. Detection is complete by then."""
_LAPS = 18
"""Repetitions of the dance, forwards and backwards, while memory is measured."""
_STEP = 33_333_333
_FLOOR_FRAMES = 60
"""Number of frames (two seconds) after which the floor is compared with the true floor."""


def figures() -> Iterator[Figure]:
    """Yields all figures, also for each real sequence."""
    warm_up_tracking()
    yield from _measure_speed()
    yield from _measure_accuracy(HELD_OUT, "tracking")
    yield from _measure_accuracy(TUNING, "tracking.tuning")
    yield from _measure_accuracy(CLOSE, "tracking.close")
    yield from _measure_accuracy(SEALED, "tracking.sealed")
    yield from _measure_accuracy(TURNS, "tracking.turns")
    yield from _measure_accuracy(SEALED_TURNS, "tracking.turns_sealed")
    yield from _measure_accuracy(FLOOR, "tracking.floor")
    yield from _measure_accuracy(SEALED_FLOOR, "tracking.floor_sealed")
    yield from _measure_accuracy(SEALED_DECEMBER, "tracking.december_sealed")
    yield from _measure_accuracy(SEALED_CONFIDENCE, "tracking.confidence_sealed")
    yield from _measure_floor(SEALED, "tracking.sealed")
    yield from _measure_real()
    yield from _measure_memory()


def _measure_accuracy(split: str, prefix: str) -> Iterator[Figure]:
    total, rough = Scores(), Scores()
    first, single_costs = [], []
    for sequence in sequences(split):
        scores = evaluated(sequence)
        (rough if sequence.kind == "trouble" else total).add(scores)
        first.append(scores.cost[0])
        if sequence.kind in ("accuracy", "still") and len(sequence.people) == 1:
            single_costs += scores.cost[_SETTLED:]
    minutes = total.minutes
    yield Figure(f"{prefix}.within_10cm", total.within, "of visible joints")
    yield Figure(f"{prefix}.within_10cm_from_first", total.within_from_first, "the same from frame 0 on")
    yield Figure(f"{prefix}.mean_error_mm", total.mean_mm, "mm")
    wrong = float((total.sure[-1] - total.sure_hits[-1]) / max(total.sure.sum(), 1))
    yield Figure(
        f"{prefix}.confident_and_wrong", wrong, "of joints: off by 10 cm with confidence 0.9 or more"
    )
    yield Figure(f"{prefix}.p99_ms", 1e3 * float(np.percentile(total.cost, 99)), "ms a frame, all films")
    yield Figure(f"{prefix}.median_ms_1", 1e3 * float(np.median(single_costs)), "ms a frame, one performer")
    yield Figure(
        f"{prefix}.p99_ms_1", 1e3 * float(np.percentile(single_costs, 99)), "ms a frame, one performer"
    )
    yield Figure(f"{prefix}.first_frame_ms", 1e3 * max(first), "ms, the slowest first frame")
    if total.jitter:
        yield Figure(f"{prefix}.jitter_mm", float(np.mean(total.jitter)), "mm")
    if total.recovery:
        yield Figure(f"{prefix}.recovery_ms", mean_recovery(total), "ms")
        recovered = float(np.mean(np.isfinite(total.recovery)))
        yield Figure(f"{prefix}.recovered", recovered, "of forced losses")
    yield Figure(f"{prefix}.swaps_per_minute", (total.identity + total.mirrored) / minutes, "1/min")
    yield Figure(f"{prefix}.identity_swaps_per_minute", total.identity / minutes, "1/min")
    yield Figure(f"{prefix}.left_right_swaps_per_minute", total.mirrored / minutes, "1/min")
    yield Figure(f"{prefix}.false_bodies_per_minute", total.false / minutes, "1/min")
    yield Figure(f"{prefix}.within_when_sure", total.trusted(0.9), "of joints with confidence 0.9 or more")
    reported = rough.told + total.told
    if reported:
        yield Figure(f"{prefix}.trouble.within_10cm", rough.within, "of visible joints, bad input")
        yield Figure(
            f"{prefix}.trouble.told", float(np.mean(reported)), "of troubles with the input were said"
        )
    for part, degrees in total.turned.items():
        if degrees:
            yield Figure(f"{prefix}.turned_wrong.{part}", float(np.median(degrees)), "degrees, median")
    if total.standing:
        yield Figure(f"{prefix}.contacts", float(np.mean(total.standing)), "of feet in view told rightly")
    for joint in range(20):
        share = float(total.hits[joint] / max(total.visible[joint], 1))
        yield Figure(f"{prefix}.within_10cm.{joint_label(joint)}", share, "of visible joints")


def _measure_floor(split: str, prefix: str) -> Iterator[Figure]:
    """Yields the floor's tilt error, the sensor height's error, and the time of detection. Each is the worst
    of all films.
    """
    tilts, heights, delays = [], [], []
    for sequence in sequences(split):
        tracker, since = Tracker(), np.inf
        frames = [frame for frame, _ in rendered(sequence)[:_FLOOR_FRAMES]]
        for frame in frames:
            tracker.track(frame)
            if tracker.state is not None and tracker.state.floor_known:
                since = min(since, (frame.time_ns - frames[0].time_ns) * 1e-9)
        true, fitted = (
            world_from_level_camera(sequence.height, np.radians(sequence.tilt)),
            tracker.world_from_camera,
        )
        assert fitted is not None, sequence.name
        tilts.append(np.degrees(np.arccos(min(1.0, float(true[1, :3] @ fitted[1, :3])))))
        heights.append(100.0 * abs(float(true[1, 3] - fitted[1, 3])))
        delays.append(since)
    yield Figure(f"{prefix}.floor_tilt_max", max(tilts), "degrees, the worst film")
    yield Figure(f"{prefix}.floor_height_max", max(heights), "cm, the worst film")
    yield Figure(f"{prefix}.floor_found_max", max(delays), "s, the latest film")


def _measure_speed() -> Iterator[Figure]:
    """Yields frames per second on one core at 640 x 400, with one performer and with four."""
    for name, only in (("fps_1", "h traffic"), ("fps_4", "h four")):
        films = sequences(HELD_OUT, only) or sequences(HELD_OUT, "h one leg")
        frames = [frame for frame, _ in rendered(films[0])]
        tracker, cost, people = Tracker(), [], []
        for frame in frames:
            start = time.perf_counter()
            people.append(len(tracker.track(frame)))
            cost.append(time.perf_counter() - start)
        followed = np.array(people[_TAKEN_UP:]) == max(people[_TAKEN_UP:])
        seconds = float(np.mean(np.array(cost[_TAKEN_UP:])[followed]))
        yield Figure(f"tracking.{name}", 1.0 / seconds, f"frames/s with {max(people[_TAKEN_UP:])} tracked")


def _measure_memory() -> Iterator[Figure]:
    """Yields the growth of the process during one performer's endless dance, per hour at 30 frames per
    second.
    """
    page = Path("/proc/self/statm")
    if not page.exists():
        return
    frames = [frame for frame, _ in rendered(sequences(HELD_OUT, "h one leg")[0])]
    tracker, sizes = Tracker(), []
    for lap in range(_LAPS):
        there = frames if lap % 2 == 0 else frames[::-1]
        for n, frame in enumerate(there):
            tracker.track(replace(frame, time_ns=(lap * len(frames) + n) * _STEP))
        sizes.append(int(page.read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 1e6)
    settled = sizes[_LAPS // 3 :]
    hours = len(settled) * len(frames) * _STEP * 1e-9 / 3600
    growth = float(np.polyfit(np.linspace(0.0, hours, len(settled)), settled, 1)[0])
    yield Figure("tracking.memory_growth", growth, "MB/hour")


def _measure_real() -> Iterator[Figure]:
    for real in tracking_real.with_joints():
        s = real.scores()
        yield Figure(f"tracking.{real.name}.within_10cm", s.within, "of the sensor maker's joints")
        yield Figure(f"tracking.{real.name}.mean_error_mm", s.mean_mm, "mm")
        yield Figure(f"tracking.{real.name}.identity_swaps", float(s.identity), "in all")
    if (DATA / "depth" / "skeltrack_kinect1").is_dir():
        within, apart, _ = tracking_real.skeltrack()
        yield Figure("tracking.skeltrack.within_10cm", within, "of joints marked by eye, image plane")
        yield Figure("tracking.skeltrack.mean_error_mm", apart, "mm in the image plane")
        held, _, _ = tracking_real.skeltrack(30)
        yield Figure("tracking.skeltrack.within_10cm_after_1s", held, "the same image for a second")
    if (DATA / "depth" / "uva_cv2_person_turn").is_dir():
        inside, legs, bodies = tracking_real.uva()
        yield Figure("tracking.uva_turn.on_the_person", inside, "of upper joints within the mask")
        yield Figure("tracking.uva_turn.legs_confidence", legs, "mean; the legs are never in view")
        yield Figure("tracking.uva_turn.identities", float(len({b.id for some in bodies for b in some})), "")
