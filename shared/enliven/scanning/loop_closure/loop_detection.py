"""Loop detection and loop closure: aligns submaps of a trajectory with each other, and corrects the whole
trajectory.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from enliven.arrays import Float
from enliven.camera import project
from enliven.scanning.depth_view import DepthPreparation, DepthView
from enliven.scanning.frame_to_model_tracking import Alignment, CameraTracker
from enliven.scanning.keyframes import image_differences
from enliven.scanning.loop_closure.history import FrameHistory
from enliven.scanning.loop_closure.pose_graph import PoseLink, optimize_poses
from enliven.scanning.loop_closure.submaps import PlacedPiece, SubMap, piece_tracker, split_trajectory
from enliven.scanning.rigid import interpolate_poses, invert_pose, pose_difference
from enliven.scanning.settings import MIN_OVERLAP_FRACTION, ScanSettings
from enliven.scanning.threads import run_in_two_threads

_SUBMAP_TRAVEL_M = 0.3
"""Maximum distance of the camera from the start of a submap."""
_SUBMAP_ROTATION_RAD = 0.35
"""Maximum rotation of the camera from the start of a submap."""
_UP_SIGMA_RAD = 0.01
"""Standard deviation of the up direction from the accelerometer."""
_HALF_WEIGHT_SQUARED_ERROR = 50.0
"""Squared error, in standard deviations, at which a loop closure has half its weight."""
_TYPICAL_DEPTH_M = 1.2
"""Depth of the point in the middle of an image at which displacements of the image are measured."""
_MIN_REPORTED_ERROR_SIGMAS = 1.0
"""Error of a loop, in standard deviations, above which its gap is reported."""
_TRACKED_SIGMA_M = 0.0015
"""Standard deviation of the tracked position between successive submaps."""
_TRACKED_SIGMA_RAD = 0.001
"""Standard deviation of the tracked rotation between successive submaps."""
_MIN_SHARED_FRACTION = 0.4
"""Minimum overlap of two images, as a fraction, for a loop closure by position."""
_MAX_INVERSE_DEPTH_DIFFERENCE = 0.15
"""Maximum difference in inverse depth for images that count as similar, in 1/m."""
_MAX_TESTED_SUBMAPS = 2
"""Maximum number of earlier submaps to test for loop closure, by position and by appearance each."""
_MIN_AGREEING_LOOP_FRACTION = 0.6
"""Minimum fraction of a submap's points on the other submap's surface for a loop closure."""
_MAX_ALIGNMENT_DISTANCE_M = 0.02
"""Maximum distance between the two alignments of a submap pair (forward and backward)."""
_MAX_ALIGNMENT_ANGLE_RAD = 0.015
"""Maximum angle between these two alignments."""
_MIN_LOOP_SIGMA_M = 0.003
"""Minimum standard deviation of position assumed for a loop closure."""
_MIN_LOOP_SIGMA_RAD = 0.002
"""Minimum standard deviation of rotation assumed for a loop closure."""

_TRACKED_NEIGHBOURS = 2
"""Number of submaps after a submap that are already aligned with it by tracking. They are not loop
candidates."""
_GRID_POINTS = 8
"""Number of grid points per row and column of an image. They are projected into another image to measure the
overlap of the two images."""
_MIN_AXIS_COSINE = 0.5
"""Minimum cosine (60 degrees) between two optical axes. Below it, the cameras see different sides of
objects."""
_MIN_PROJECTION_DISTANCE_M = 0.1
"""Minimum depth, metres, of points that are projected into an image."""
_MIN_LOOP_TRUST = 0.25
"""Minimum trust in a loop, 0 to 1. Below it, the loop counts as false."""


@dataclass(frozen=True)
class LoopClosure:
    """The result of a loop closure.

    Attributes:
        poses: (4, 4) corrected poses of all images, world_from_camera.
        pieces: the submaps, in the order of the trajectory.
        links: pose graph edges between submaps. Edges that are not ``sure`` are loops.
        loops: the number of loops that are trusted.
        gap: the largest error of a trusted loop before the correction, metres, measured at the point in the
            middle
            of an image. 0 if no loop is trusted.
        moved: the largest displacement of the point in the middle of an image by the correction, metres.
        taken: True if the scan was fused again at these poses.
    """

    poses: list[Float]
    pieces: list[SubMap]
    links: list[PoseLink]
    loops: int
    gap: float
    moved: float
    views: list[DepthView] = field(repr=False)
    taken: bool = False

    def agreement(self, tracker: CameraTracker, poses: Sequence[Float]) -> float:
        """Returns the mean fraction of the submaps' points that lie on the fused surface if their images are
        placed at the given poses.
        """
        shares = [
            tracker.evaluate(view, poses[piece.anchor]).agreeing
            for view, piece in zip(self.views, self.pieces, strict=True)
        ]
        return float(np.mean(shares))


def correct_trajectory(
    history: FrameHistory,
    poses: Sequence[Float],
    ups: Sequence[Float | None],
    preparation: DepthPreparation,
    settings: ScanSettings,
) -> LoopClosure:
    """Corrects the trajectory of a camera, so that surfaces that were seen twice coincide.

    Args:
        poses: (4, 4) of each image, from tracking.
        ups: (3,) unit vectors, camera frame, that point up, or None, for each image.
    """
    pieces = split_trajectory(poses, history.numbers, _SUBMAP_TRAVEL_M, _SUBMAP_ROTATION_RAD)
    placed_pieces = [_load_piece(history, piece, poses, preparation) for piece in pieces]
    links = _find_all_links(placed_pieces, settings)
    anchors = [piece.pose for piece in placed_pieces]
    measured_ups = [ups[piece.anchor] for piece in pieces]
    corrected_anchors, trusts = optimize_poses(
        anchors, links, measured_ups, _UP_SIGMA_RAD, _HALF_WEIGHT_SQUARED_ERROR
    )
    trusted_links = [
        link for link, trust in zip(links, trusts, strict=True) if not link.sure and trust > _MIN_LOOP_TRUST
    ]
    middle = np.array([0.0, 0.0, _TYPICAL_DEPTH_M, 1.0])
    gaps = [
        gap
        for gap in (_link_gap(anchors, link, middle, _MIN_REPORTED_ERROR_SIGMAS) for link in trusted_links)
        if gap
    ]
    corrected_poses = _correct_poses(poses, [piece.anchor for piece in pieces], corrected_anchors)
    displacement = max(
        float(np.linalg.norm((a - b) @ middle)) for a, b in zip(poses, corrected_poses, strict=True)
    )
    return LoopClosure(
        corrected_poses,
        pieces,
        links,
        len(trusted_links),
        max(gaps, default=0.0),
        displacement,
        [piece.view for piece in placed_pieces],
    )


def _link_gap(anchors: list[Float], link: PoseLink, middle: Float, max_deviations: float) -> float:
    """Returns the error of a link before the correction, metres, measured at the point in the middle of an
    image. Returns 0 if the error is within ``max_deviations`` standard deviations of the link.
    """
    error_transform = anchors[link.second] - anchors[link.first] @ link.first_from_second
    gap = float(np.linalg.norm(error_transform @ middle))
    deviation = float(np.linalg.eigvalsh(link.information[:3, :3])[0]) ** -0.5
    return gap if gap > max_deviations * deviation else 0.0


def _load_piece(
    history: FrameHistory, piece: SubMap, poses: Sequence[Float], preparation: DepthPreparation
) -> PlacedPiece:
    """Returns a submap with its images, which are decompressed and prepared."""
    images = {
        number: (frame, poses[number])
        for number, frame in history.frames([piece.anchor, *piece.fused_numbers])
    }
    return PlacedPiece(piece, images, preparation)


def _find_all_links(pieces: list[PlacedPiece], settings: ScanSettings) -> list[PoseLink]:
    """Returns the tracked links between successive submaps, and the loops with successful alignments in both
    directions."""
    candidates = _loop_candidates(pieces)
    alignments = _candidate_alignments(pieces, candidates, settings)
    links = [_track_link(pieces, n) for n in range(len(pieces) - 1)]
    for (n, m), alignment in alignments.items():
        if (m, n) in alignments and _is_consistent(pieces, n, m, alignment, alignments[m, n]):
            links.append(_make_link(pieces, n, m, alignment))
    return links


def _candidate_alignments(
    pieces: list[PlacedPiece], candidates: set[tuple[int, int]], settings: ScanSettings
) -> dict[tuple[int, int], Alignment]:
    """Aligns the candidate pairs of submaps. Returns the successful alignments of submap m with submap n
    under the key (n, m).

    Both directions of each pair are tried.
    """
    alignments: dict[tuple[int, int], Alignment] = {}
    partners: list[list[int]] = [[] for _ in pieces]
    for n, m in candidates:
        partners[n].append(m)
        partners[m].append(n)

    def lay(tracker: CameraTracker, n: int) -> None:
        pieces[n].fuse_into(tracker.volumes)
        for m in partners[n]:
            alignment = _align_piece(tracker, pieces[m], pieces[n], settings)
            if alignment is not None:
                alignments[n, m] = alignment

    run_in_two_threads(
        lay, [n for n, others in enumerate(partners) if others], lambda: piece_tracker(settings)
    )
    return dict(sorted(alignments.items()))


def _track_link(pieces: list[PlacedPiece], n: int) -> PoseLink:
    """Returns the link from submap ``n`` to the next submap, as tracking measured it."""
    relative = invert_pose(pieces[n].pose) @ pieces[n + 1].pose
    sure = np.diag([_TRACKED_SIGMA_M**-2] * 3 + [_TRACKED_SIGMA_RAD**-2] * 3)
    return PoseLink(n, n + 1, relative, sure)


def _loop_candidates(pieces: list[PlacedPiece]) -> set[tuple[int, int]]:
    """Returns the loop candidates: pairs (n, m), n < m, of non-successive submaps that may show the same
    place.
    """
    candidates: set[tuple[int, int]] = set()
    reduced_images = [piece.small for piece in pieces]
    for m in range(_TRACKED_NEIGHBOURS + 1, len(pieces)):
        earlier_pieces = pieces[: m - _TRACKED_NEIGHBOURS]
        unseen = np.array([1.0 - _compute_shared_view_fraction(pieces[m], other) for other in earlier_pieces])
        unlike = image_differences(reduced_images[m], reduced_images[: m - _TRACKED_NEIGHBOURS])
        for measure, max_value in (
            (unseen, 1.0 - _MIN_SHARED_FRACTION),
            (unlike, _MAX_INVERSE_DEPTH_DIFFERENCE),
        ):
            candidates |= {
                (int(n), m) for n in np.argsort(measure)[:_MAX_TESTED_SUBMAPS] if measure[n] < max_value
            }
    return candidates


def _compute_shared_view_fraction(piece: PlacedPiece, other: PlacedPiece) -> float:
    """Returns the fraction of a submap's view that the camera of another submap also sees from about the same
    side.
    """
    if piece.pose[:3, 2] @ other.pose[:3, 2] < _MIN_AXIS_COSINE:
        return 0.0
    points = piece.view.points
    rows = np.linspace(0, points.shape[0] - 1, _GRID_POINTS).astype(int)
    columns = np.linspace(0, points.shape[1] - 1, _GRID_POINTS).astype(int)
    samples = points[np.ix_(rows, columns)].reshape(-1, 3)
    samples = samples[samples[:, 2] > 0]
    other_from_piece = invert_pose(other.pose) @ piece.pose
    local = samples @ other_from_piece[:3, :3].T + other_from_piece[:3, 3]
    is_in_front = local[:, 2] > _MIN_PROJECTION_DISTANCE_M
    if not is_in_front.any():
        return 0.0
    lens = other.view.intrinsics
    pixels = project(local[is_in_front], lens)
    inside = (pixels >= 0).all(1) & (pixels[:, 0] < lens.width) & (pixels[:, 1] < lens.height)
    return float(inside.sum()) / _GRID_POINTS**2


def _align_piece(
    tracker: CameraTracker, piece: PlacedPiece, onto: PlacedPiece, settings: ScanSettings
) -> Alignment | None:
    """Returns the alignment of a submap's anchor image with another submap, or None if it fails."""
    alignment = tracker.align(piece.view, piece.pose)
    if not _is_good(alignment, settings):
        other = tracker.align(piece.view, onto.pose)
        alignment = max(alignment, other, key=lambda laid: laid.agreeing * laid.overlap)
    return alignment if _is_good(alignment, settings) else None


def _is_good(alignment: Alignment, settings: ScanSettings) -> bool:
    """Returns True if an alignment is good enough for a link."""
    return (
        alignment.agreeing > _MIN_AGREEING_LOOP_FRACTION
        and alignment.overlap > MIN_OVERLAP_FRACTION
        and alignment.deviation < settings.tracking.unsure
    )


def _is_consistent(pieces: list[PlacedPiece], n: int, m: int, one: Alignment, other: Alignment) -> bool:
    """Returns True if the alignment of m with n is consistent with the alignment of n with m."""
    correction = one.world_from_camera @ invert_pose(pieces[m].pose)
    move, turn = pose_difference(pieces[n].pose, correction @ other.world_from_camera)
    return move < _MAX_ALIGNMENT_DISTANCE_M and turn < _MAX_ALIGNMENT_ANGLE_RAD


def _make_link(pieces: list[PlacedPiece], n: int, m: int, alignment: Alignment) -> PoseLink:
    """Returns the pose graph link between submaps n and m for their alignment."""
    turn = pieces[n].pose[:3, :3].T
    both = np.kron(np.eye(2), turn)
    covariance = both @ alignment.covariance @ both.T
    covariance += np.diag([_MIN_LOOP_SIGMA_M**2] * 3 + [_MIN_LOOP_SIGMA_RAD**2] * 3)
    relative = invert_pose(pieces[n].pose) @ alignment.world_from_camera
    return PoseLink(n, m, relative, np.asarray(np.linalg.inv(covariance), np.float64), sure=False)


def _correct_poses(poses: Sequence[Float], anchors: list[int], better: list[Float]) -> list[Float]:
    """Returns the corrected poses (4, 4) of all images. The correction of an image is interpolated between
    those of the nearest anchor images before and after it.
    """
    corrections = [new @ invert_pose(poses[anchor]) for anchor, new in zip(anchors, better, strict=True)]
    corrected = []
    for number, pose in enumerate(poses):
        next_anchor = int(np.searchsorted(anchors, number))
        low, high = max(next_anchor - 1, 0), min(next_anchor, len(anchors) - 1)
        span = anchors[high] - anchors[low]
        fraction = (number - anchors[low]) / span if span else 0.0
        corrected.append(interpolate_poses(corrections[low] @ pose, corrections[high] @ pose, fraction))
    return corrected
