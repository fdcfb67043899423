"""A scan's way in pieces: images near one another are one stiff map, against which others are laid."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from enliven.arrays import Float, Float32
from enliven.frames import DepthFrame
from enliven.scanning.camera_tracker import CameraTracker
from enliven.scanning.depth_view import DepthPreparation, DepthView
from enliven.scanning.keyframes import reduced
from enliven.scanning.rigid import apart
from enliven.scanning.settings import ScanSettings
from enliven.scanning.volume import DistanceVolume

_COARSER = (2.0, 8.0)
"""Voxels of a piece's volumes, of the scan's: bands of 3 and 13 cm at 4 mm, at a tenth of the time."""
_STRIDE = 4
"""Half-size pixels between the points that are laid onto a piece: a quarter of the tracking's."""
_LOOKS = 4
"""Images of a piece that are fused at most: each next one brings less."""


@dataclass(frozen=True)
class SubMap:
    """A piece of a scan's way.

    Attributes:
        numbers: of its images, in their order.
    """

    numbers: tuple[int, ...]

    @property
    def anchor(self) -> int:
        """The number of the image in its middle, which stands for the piece."""
        return self.numbers[len(self.numbers) // 2]


def split_way(poses: Sequence[Float], numbers: Sequence[int], metres: float, radians: float) -> list[SubMap]:
    """Returns the pieces of a way; in each the camera stays so near to where it began.

    Args:
        poses: (4, 4) of all images.
        numbers: of those that are there.
    """
    pieces: list[list[int]] = []
    for number in numbers:
        far = not pieces
        if pieces:
            move, turn = apart(poses[pieces[-1][0]], poses[number])
            far = move > metres or turn > radians
        if far:
            pieces.append([])
        pieces[-1].append(number)
    return [SubMap(tuple(piece)) for piece in pieces]


class PlacedPiece:
    """A piece with its images: its anchor's view, and volumes that are fused when they are asked for."""

    def __init__(
        self, images: Sequence[tuple[DepthFrame, Float]], anchor: int, preparation: DepthPreparation
    ) -> None:
        keep = np.unique(np.linspace(0, len(images) - 1, min(_LOOKS, len(images))).astype(int))
        self._images, self._preparation = [images[n] for n in keep], preparation
        view = preparation.prepare(images[anchor][0].depth)
        # The planes of the full image are for the fusion, and large.
        empty = np.empty((0, 0), np.float32)
        self.view: DepthView = replace(view, planes=empty, weights=empty)
        self.small: Float32 = reduced(view)
        self.pose: Float = images[anchor][1]

    def tracker(self, settings: ScanSettings) -> CameraTracker:
        """Returns what lays images onto this piece; its volumes go when it goes."""
        sizes = [settings.volume.voxel * factor for factor in _COARSER]
        plain = replace(settings.volume, colour=False)
        volumes = [DistanceVolume(plain, size, settings.volume.far) for size in sizes]
        for frame, pose in self._images:
            view = self._preparation.prepare(frame.depth)
            for volume in volumes:
                volume.integrate(view, pose)
        t = settings.tracking
        # Fewer points tell as much: their neighbours' noise is not new.
        told = min(t.independent * (_STRIDE / t.fine_stride) ** 2, 1.0)
        return CameraTracker(volumes, replace(t, fine_stride=_STRIDE, independent=told))
