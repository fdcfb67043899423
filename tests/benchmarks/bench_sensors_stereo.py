"""Measures stereo depth on rendered image pairs with known depth, compared with plain OpenCV on the same
pairs.

The peer is OpenCV's own stereo matching example in its fastest mode. It uses the same maps and number of
disparities, the recommended penalties, its own depth formula, and neither speckle nor uniqueness filter.
Speed is processor time on one core. Both are measured alternately, and the shortest time of several rounds
counts.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import cv2
import numpy as np
from figure import Figure

sys.path.insert(0, str(Path(__file__).parents[1] / "helpers"))
from stereo_rig import calibration_of, create_lenses, rectified_left
from stereo_scene import Renderer, person, room

from enliven_edge.sensors.stereo.matching import StereoMatcher
from enliven_edge.sensors.stereo.rectification import Rectification

WIDTH, HEIGHT = 640, 400
DISTANCES = (1, 2, 3)
"""Distances of the person from the cameras, metres."""
SEEDS = 3
"""Number of rooms per distance, with different textures and noise."""
ROUNDS, FRAMES = 7, 10
WRONG = 0.05
"""A pixel is wrong, rather than noisy, if its error exceeds this fraction of its distance."""
PEER = "plain cv2 StereoSGBM, 3WAY"


class Plain:
    """OpenCV's example of stereo matching, in its fastest mode."""

    def __init__(self, rectification: Rectification, disparities: int) -> None:
        self._rectification = rectification
        self._matcher = cv2.StereoSGBM_create(
            0, disparities, 5, 8 * 25, 32 * 25, mode=cv2.STEREO_SGBM_MODE_SGBM_3WAY
        )

    def depth(self, left: np.ndarray, right: np.ndarray) -> np.ndarray:
        """Returns (H, W) millimetres, 0 where unknown."""
        disparity = self._matcher.compute(*self._rectification.rectify(left, right)).astype(np.float32) / 16
        scale = 1e3 * self._rectification.intrinsics.fx * self._rectification.baseline
        with np.errstate(divide="ignore"):
            return np.where(disparity > 0, scale / disparity, 0)


def figures() -> Iterator[Figure]:
    """Yields images per second, errors on a person at three distances, and the completeness on the person."""
    cv2.setNumThreads(1)
    lenses = create_lenses(WIDTH, HEIGHT)
    rectification = Rectification(calibration_of(*lenses))
    ours = StereoMatcher(rectification)
    peer = Plain(rectification, 64)
    scenes = {z: [_make_scene(lenses, rectification, z, seed) for seed in range(SEEDS)] for z in DISTANCES}
    left, right, *_ = scenes[2][0]
    fast, plain = _measure_fps([lambda: ours.depth(left, right), lambda: peer.depth(left, right)])
    yield Figure("sensors.stereo_fps", fast, "images a second on one core", PEER, fast / plain)
    for z in DISTANCES:
        error, known_share, wrong = _measure_errors(ours.depth, scenes[z])
        others, _, others_wrong = _measure_errors(peer.depth, scenes[z])
        name = "" if z == 2 else f".{z}m"
        yield Figure(f"sensors.stereo_error_mm{name}", error, f"mm at {z} m", PEER, others / error)
        yield Figure(f"sensors.stereo_known{name}", 100 * known_share, "% of the person")
        yield Figure(f"sensors.stereo_wrong{name}", 100 * wrong, "% of that", PEER, others_wrong / wrong)


def _make_scene(lenses, rectification: Rectification, distance: float, seed: int) -> tuple[np.ndarray, ...]:
    """Returns (left, right, true depth in metres, mask of the person)."""
    walls = room(wall=distance + 1.5)
    photographer = Renderer(walls + person(0.1 * seed, distance), seed)
    images = [
        photographer.render_image(lens, gain=gain, vignette=0.3, noise=2.0)
        for lens, gain in zip(lenses, (1.0, 1.08), strict=True)
    ]
    truth, which = photographer.render_hits(rectified_left(rectification))
    return *images, truth, which >= len(walls)


def _measure_errors(
    depth: Callable[..., np.ndarray], scenes: list[tuple[np.ndarray, ...]]
) -> tuple[float, float, float]:
    """Returns (median error in millimetres, fraction of the person with depth, fraction of that which is
    wrong)."""
    off, shares, all_off = [], [], []
    for left, right, truth, body in scenes:
        metres = 1e-3 * depth(left, right)
        is_known = body & (metres > 0)
        off.append(np.abs(metres - truth)[is_known])
        all_off.append(off[-1] / truth[is_known])
        shares.append(is_known.sum() / body.sum())
    median = 1e3 * float(np.median(np.concatenate(off)))
    return median, float(np.mean(shares)), float((np.concatenate(all_off) > WRONG).mean())


def _measure_fps(works: list[Callable[[], object]]) -> list[float]:
    """Returns calls per second of processor time. The functions are measured alternately."""
    least = [np.inf] * len(works)
    for _ in range(ROUNDS):
        for number, work in enumerate(works):
            start = time.process_time()
            for _ in range(FRAMES):
                work()
            least[number] = min(least[number], (time.process_time() - start) / FRAMES)
    return [1 / each for each in least]
