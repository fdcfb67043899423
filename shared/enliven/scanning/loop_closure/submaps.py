"""Submaps of a scan's trajectory. Successive images with nearby poses form a submap, a rigid map with which
other submaps are aligned.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from enliven.arrays import Float, Float32
from enliven.frames import DepthFrame
from enliven.scanning.depth_view import DepthPreparation, DepthView
from enliven.scanning.frame_to_model_tracking import CameraTracker
from enliven.scanning.keyframes import reduce_view
from enliven.scanning.rigid import pose_difference
from enliven.scanning.settings import ScanSettings
from enliven.scanning.tsdf_volume import TsdfVolume

_VOXEL_RATIOS = (2.0, 8.0)
"""Voxel sizes of a submap's volumes, relative to the scan's. If the scan has 4 mm voxels, the truncation
bands are 3 and 13 cm wide. With these sizes, alignment takes a tenth of the time of tracking."""
_PIXEL_STRIDE = 4
"""Spacing, in half-size pixels, of the points that are aligned with a submap. Tracking uses four times as
many points."""
_MAX_IMAGES = 3
"""Maximum number of images of a submap that are fused. More images would add little."""


@dataclass(frozen=True)
class SubMap:
    """A section of a scan's trajectory.

    Attributes:
        numbers: the numbers of its images, in ascending order.
    """

    numbers: tuple[int, ...]

    @property
    def anchor(self) -> int:
        """The number of the image in its middle, which represents the submap."""
        return self.numbers[len(self.numbers) // 2]

    @property
    def fused_numbers(self) -> list[int]:
        """The numbers of the images that are fused when other submaps are aligned with this one."""
        indices = np.unique(
            np.linspace(0, len(self.numbers) - 1, min(_MAX_IMAGES, len(self.numbers))).astype(int)
        )
        return [self.numbers[n] for n in indices]


def split_trajectory(
    poses: Sequence[Float], numbers: Sequence[int], metres: float, radians: float
) -> list[SubMap]:
    """Returns the submaps of a trajectory. Within each submap, the camera stays within the limits around its
    first pose.

    Args:
        poses: (4, 4) of all images.
        numbers: the numbers of the stored images.
        metres: maximum distance from the start of the submap.
        radians: maximum rotation from the start of the submap.
    """
    pieces: list[list[int]] = []
    for number in numbers:
        starts_piece = not pieces
        if pieces:
            distance, angle = pose_difference(poses[pieces[-1][0]], poses[number])
            starts_piece = distance > metres or angle > radians
        if starts_piece:
            pieces.append([])
        pieces[-1].append(number)
    return [SubMap(tuple(piece)) for piece in pieces]


class PlacedPiece:
    """A submap with its images.

    Attributes:
        view: the anchor's image, without the planes of the full image, which are large and only needed for
            fusion.
        small: the same image, reduced in the same way as a keyframe.
        pose: (4, 4) pose of the anchor, world_from_camera.

    Args:
        images: images with their poses, by number. They include at least the anchor and the
            ``fused_numbers``.
    """

    def __init__(
        self, piece: SubMap, images: Mapping[int, tuple[DepthFrame, Float]], preparation: DepthPreparation
    ) -> None:
        self._images, self._preparation = [images[n] for n in piece.fused_numbers], preparation
        frame, self.pose = images[piece.anchor]
        view, empty = preparation.prepare(frame.depth), np.empty((0, 0), np.float32)
        self.view: DepthView = replace(view, planes=empty, weights=empty)
        self.small: Float32 = reduce_view(view)

    def fuse_into(self, volumes: Sequence[TsdfVolume]) -> None:
        """Clears the volumes and fuses the submap's ``fused_numbers`` into them."""
        for volume in volumes:
            volume.clear()
        for frame, pose in self._images:
            view = self._preparation.prepare(frame.depth)
            for volume in volumes:
                volume.integrate(view, pose)


def piece_tracker(settings: ScanSettings) -> CameraTracker:
    """Returns the tracker that aligns images with the submap that was last fused into its volumes."""
    colourless, t = replace(settings.volume, colour=False), settings.tracking
    depth_limits = (colourless.reach, colourless.far)
    # With a larger stride, each point carries more independent information, because the noise of adjacent
    # pixels is correlated.
    independent = min(t.independent * (_PIXEL_STRIDE / t.fine_stride) ** 2, 1.0)
    return CameraTracker(
        [
            TsdfVolume(colourless, colourless.voxel * n, far)
            for n, far in zip(_VOXEL_RATIOS, depth_limits, strict=True)
        ],
        replace(t, fine_stride=_PIXEL_STRIDE, independent=independent),
    )
