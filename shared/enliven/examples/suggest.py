"""Suggests frames of a motion as key poses, and the number of key poses that is enough. The suggested frames
differ most from one another.

suggested = suggest_poses(performed(clip, joints).poses)      # frames, and remaining distances
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from enliven.arrays import Bool, Float
from enliven.errors import InputError
from enliven.settings import parameter

_OUTLIER_DISTANCE_RATIO = 0.5
"""Minimum distance of a single frame from both neighbours, as a fraction of the median distance. Frames
beyond it are ignored as tracking outliers."""


@dataclass(frozen=True)
class SuggestSettings:
    """Settings of the suggestion of key poses: the maximum number, and the distance at which the examples are
    enough."""

    most: int = parameter(12, "Maximum number of suggested key poses.", low=2, high=1000)
    enough: float = parameter(
        0.7,
        "Key poses are enough if every pose is nearer to a key pose than this fraction of the "
        "largest distance to the first key pose. "
        "Lower values give more suggestions.",
        low=0.0,
        high=1.0,
    )


@dataclass(frozen=True, eq=False)
class SuggestedPoses:
    """Suggested key poses, the most important first.

    Attributes:
        frames: (K,) frames of the motion. The first is the one nearest to the median pose.
        gaps: (K,) metres. Entry k is the root-mean-square distance of the farthest pose from the first k + 1
            key poses.
        count: number of key poses that are enough.
    """

    frames: tuple[int, ...]
    gaps: tuple[float, ...]
    count: int


def suggest_poses(poses: Float, settings: SuggestSettings | None = None) -> SuggestedPoses:
    """Suggests key poses of a motion (F, P, 3) in the body frame by farthest point sampling.

    Raises:
        InputError: if the motion never changes, or is not finite.
    """
    settings = settings or SuggestSettings()
    poses = np.array(poses, np.float64)
    if len(poses) < 2 or not np.isfinite(poses).all():
        raise InputError(
            f"the motion has {len(poses)} poses, but at least two are needed, and all must be finite",
            where="key poses",
        )
    frames = [int(_pose_distance(poses, np.median(poses, axis=0)).argmin())]
    distances, gaps = _pose_distance(poses, poses[frames[0]]), list[float]()
    distances[_is_outlier(poses, _OUTLIER_DISTANCE_RATIO * float(np.median(distances)))] = 0.0
    while True:
        farthest = int(distances.argmax())
        gaps.append(float(distances[farthest]))
        if gaps[-1] <= 1e-6 * gaps[0] or len(frames) == settings.most:
            break
        frames.append(farthest)
        distances = np.minimum(distances, _pose_distance(poses, poses[farthest]))
    if len(frames) < 2:
        raise InputError(
            "the performer does not move", where="key poses", remedy="Choose another part of the take."
        )
    small_counts = [k + 1 for k, gap in enumerate(gaps) if gap <= settings.enough * gaps[0]]
    return SuggestedPoses(
        tuple(frames), tuple(gaps), max(2, small_counts[0] if small_counts else len(frames))
    )


def suggest_further_poses(
    poses: Float, known: Float, settings: SuggestSettings | None = None
) -> SuggestedPoses:
    """Suggests key poses in addition to existing examples (n, P, 3), all in the body frame.

    Returns:
        The suggested frames, the most important first. ``gaps[k]`` is the remaining distance with the first k
        frames, so ``gaps`` has one entry more than ``frames``. ``count`` is the number of frames that are
        enough, 0 if none is needed.

    Raises:
        InputError: in the same cases as :func:`suggest_poses`.
    """
    settings = settings or SuggestSettings()
    poses = np.array(poses, np.float64)
    is_outlier = suggest_poses(poses, settings)
    distances = distance_to(poses, known)
    distances[
        _is_outlier(
            poses,
            _OUTLIER_DISTANCE_RATIO * float(np.median(_pose_distance(poses, poses[is_outlier.frames[0]]))),
        )
    ] = 0.0
    frames, gaps = list[int](), [float(distances.max())]
    while gaps[-1] > 1e-6 * is_outlier.gaps[0] and len(frames) + len(known) < settings.most:
        frames.append(int(distances.argmax()))
        distances = np.minimum(distances, _pose_distance(poses, poses[frames[-1]]))
        gaps.append(float(distances.max()))
    small_counts = [k for k, gap in enumerate(gaps) if gap <= settings.enough * is_outlier.gaps[0]]
    return SuggestedPoses(tuple(frames), tuple(gaps), small_counts[0] if small_counts else len(frames))


def distance_to(poses: Float, known: Float) -> Float:
    """Returns the distances (F,), in metres, from poses (F, P, 3) to the nearest of the known poses (n, P,
    3). A distance is the root mean square over the joints.
    """
    return np.asarray(np.min([_pose_distance(poses, pose) for pose in known], axis=0))


def _is_outlier(poses: Float, min_distance: float) -> Bool:
    """Returns (F,) True for frames that are far from both neighbours (tracking outliers).

    If at least half of the frames would be outliers, returns False for all.
    """
    steps = np.sqrt((np.diff(poses, axis=0) ** 2).sum(2).mean(1))
    is_alone = (np.concatenate([[np.inf], steps]) > min_distance) & (
        np.concatenate([steps, [np.inf]]) > min_distance
    )
    return is_alone if is_alone.mean() < 0.5 else np.zeros(len(poses), np.bool_)


def _pose_distance(poses: Float, pose: Float) -> Float:
    """Returns the distances (F,) between ``poses`` (F, P, 3) and one pose, in metres: the root mean square
    over the joints.
    """
    return np.asarray(np.sqrt(((poses - pose) ** 2).sum(2).mean(1)))
