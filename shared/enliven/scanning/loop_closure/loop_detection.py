"""Loop detection and loop closure: aligns submaps of a trajectory with one another and corrects the whole
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
from enliven.scanning.settings import LoopSettings, ScanSettings
from enliven.scanning.threads import run_in_two_threads

_TRACKED_NEIGHBOURS = 2
"""Number of following submaps that tracking has already aligned with a submap. They are not loop
candidates."""
_GRID_POINTS = 8
"""Points across and down an image that are projected into another image to measure the shared view."""
_MIN_AXIS_COSINE = 0.5
"""Cosine (60 degrees) between two optical axes below which the cameras see different sides of objects."""
_MIN_PROJECTION_DISTANCE_M = 0.1
"""Distance from a camera, metres, below which no point is projected into its image."""
_MIN_LOOP_TRUST = 0.25
"""Minimum trust in a loop. Below it, the loop counts as false."""


@dataclass(frozen=True)
class LoopClosure:
    """The result of a loop closure.

    Attributes:
        poses: (4, 4) of all images, world_from_camera.
        pieces: the submaps of the trajectory.
        links: pose graph edges between submaps. Edges that are not ``sure`` are loops.
        loops: the number of loops that are trusted.
        gap: metres, the largest error of a trusted loop before the correction, measured in the middle of an
            image. 0 without a trusted loop.
        moved: metres, the largest displacement of the middle of an image by the correction.
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
        """Returns the mean fraction of the submaps' points that lie at a surface, with their images at the
        given poses.
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
    """Returns the trajectory of a camera, corrected so that surfaces seen twice coincide.

    Args:
        poses: (4, 4) of each image, from tracking.
        ups: (3,) unit vectors, camera frame, that point up, or None, for each image.
    """
    s = settings.loops
    pieces = split_trajectory(poses, history.numbers, s.piece_metres, s.piece_radians)
    placed = [_load_piece(history, piece, poses, preparation) for piece in pieces]
    links = _all_links(placed, settings)
    anchors = [piece.pose for piece in placed]
    measured_ups = [ups[piece.anchor] for piece in pieces]
    better, trusts = optimize_poses(anchors, links, measured_ups, s.level, s.doubt)
    trusted_links = [
        link for link, trust in zip(links, trusts, strict=True) if not link.sure and trust > _MIN_LOOP_TRUST
    ]
    middle = np.array([0.0, 0.0, s.middle, 1.0])
    gaps = [gap for gap in (_link_gap(anchors, link, middle, s.opened) for link in trusted_links) if gap]
    bent = _correct_poses(poses, [piece.anchor for piece in pieces], better)
    moved = max(float(np.linalg.norm((a - b) @ middle)) for a, b in zip(poses, bent, strict=True))
    return LoopClosure(
        bent,
        pieces,
        links,
        len(trusted_links),
        max(gaps, default=0.0),
        moved,
        [piece.view for piece in placed],
    )


def _link_gap(anchors: list[Float], link: PoseLink, middle: Float, most: float) -> float:
    """Returns the error of a link before the correction, metres, measured at the middle of an image. 0 if it
    is within the link's standard deviation.
    """
    off = anchors[link.second] - anchors[link.first] @ link.first_from_second
    gap = float(np.linalg.norm(off @ middle))
    deviation = float(np.linalg.eigvalsh(link.information[:3, :3])[0]) ** -0.5
    return gap if gap > most * deviation else 0.0


def _load_piece(
    history: FrameHistory, piece: SubMap, poses: Sequence[Float], preparation: DepthPreparation
) -> PlacedPiece:
    """Returns a submap with its images."""
    images = {
        number: (frame, poses[number])
        for number, frame in history.frames([piece.anchor, *piece.fused_numbers])
    }
    return PlacedPiece(piece, images, preparation)


def _all_links(pieces: list[PlacedPiece], settings: ScanSettings) -> list[PoseLink]:
    """Returns the tracked links between successive submaps, and the loops with successful alignments in both
    directions."""
    candidates = _loop_candidates(pieces, settings.loops)
    alignments = _candidate_alignments(pieces, candidates, settings)
    links = [_tracked_link(pieces, n, settings.loops) for n in range(len(pieces) - 1)]
    for (n, m), alignment in alignments.items():
        if (m, n) in alignments and _is_consistent(pieces, n, m, alignment, alignments[m, n], settings.loops):
            links.append(_make_link(pieces, n, m, alignment, settings.loops))
    return links


def _candidate_alignments(
    pieces: list[PlacedPiece], candidates: set[tuple[int, int]], settings: ScanSettings
) -> dict[tuple[int, int], Alignment]:
    """Returns the alignments of submaps m with submaps n, by (n, m), for the candidate pairs that align.

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


def _tracked_link(pieces: list[PlacedPiece], n: int, s: LoopSettings) -> PoseLink:
    """Returns the link of a submap to the next one, from tracking."""
    relative = invert_pose(pieces[n].pose) @ pieces[n + 1].pose
    sure = np.diag([s.tracked_metres**-2] * 3 + [s.tracked_radians**-2] * 3)
    return PoseLink(n, n + 1, relative, sure)


def _loop_candidates(pieces: list[PlacedPiece], s: LoopSettings) -> set[tuple[int, int]]:
    """Returns the loop candidates: pairs (n, m), n < m, of non-successive submaps that may show the same
    place.
    """
    candidates: set[tuple[int, int]] = set()
    small = [piece.small for piece in pieces]
    for m in range(_TRACKED_NEIGHBOURS + 1, len(pieces)):
        before = pieces[: m - _TRACKED_NEIGHBOURS]
        unseen = np.array([1.0 - _shared_view_fraction(pieces[m], other) for other in before])
        unlike = image_differences(small[m], small[: m - _TRACKED_NEIGHBOURS])
        for measure, most in ((unseen, 1.0 - s.shared), (unlike, s.unlike)):
            candidates |= {(int(n), m) for n in np.argsort(measure)[: s.tried] if measure[n] < most}
    return candidates


def _shared_view_fraction(piece: PlacedPiece, other: PlacedPiece) -> float:
    """Returns the fraction of a submap's view that another camera also sees, from about the same side."""
    if piece.pose[:3, 2] @ other.pose[:3, 2] < _MIN_AXIS_COSINE:
        return 0.0
    points = piece.view.points
    rows = np.linspace(0, points.shape[0] - 1, _GRID_POINTS).astype(int)
    columns = np.linspace(0, points.shape[1] - 1, _GRID_POINTS).astype(int)
    samples = points[np.ix_(rows, columns)].reshape(-1, 3)
    samples = samples[samples[:, 2] > 0]
    other_from_piece = invert_pose(other.pose) @ piece.pose
    local = samples @ other_from_piece[:3, :3].T + other_from_piece[:3, 3]
    ahead = local[:, 2] > _MIN_PROJECTION_DISTANCE_M
    if not ahead.any():
        return 0.0
    lens = other.view.intrinsics
    at = project(local[ahead], lens)
    inside = (at >= 0).all(1) & (at[:, 0] < lens.width) & (at[:, 1] < lens.height)
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
    s = settings.loops
    return (
        alignment.agreeing > s.agreeing
        and alignment.overlap > settings.tracking.overlap
        and alignment.deviation < settings.tracking.unsure
    )


def _is_consistent(
    pieces: list[PlacedPiece], n: int, m: int, one: Alignment, other: Alignment, s: LoopSettings
) -> bool:
    """Returns True if the alignment of m with n is consistent with the alignment of n with m."""
    correction = one.world_from_camera @ invert_pose(pieces[m].pose)
    move, turn = pose_difference(pieces[n].pose, correction @ other.world_from_camera)
    return move < s.agree_metres and turn < s.agree_radians


def _make_link(pieces: list[PlacedPiece], n: int, m: int, alignment: Alignment, s: LoopSettings) -> PoseLink:
    """Returns the link for an alignment."""
    turn = pieces[n].pose[:3, :3].T
    both = np.kron(np.eye(2), turn)
    covariance = both @ alignment.covariance @ both.T
    covariance += np.diag([s.metres**2] * 3 + [s.radians**2] * 3)
    relative = invert_pose(pieces[n].pose) @ alignment.world_from_camera
    return PoseLink(n, m, relative, np.asarray(np.linalg.inv(covariance), np.float64), sure=False)


def _correct_poses(poses: Sequence[Float], anchors: list[int], better: list[Float]) -> list[Float]:
    """Returns all poses, corrected by interpolating the corrections of the anchors before and after them."""
    turned = [new @ invert_pose(poses[at]) for at, new in zip(anchors, better, strict=True)]
    out = []
    for number, pose in enumerate(poses):
        after = int(np.searchsorted(anchors, number))
        low, high = max(after - 1, 0), min(after, len(anchors) - 1)
        span = anchors[high] - anchors[low]
        share = (number - anchors[low]) / span if span else 0.0
        out.append(interpolate_poses(turned[low] @ pose, turned[high] @ pose, share))
    return out
