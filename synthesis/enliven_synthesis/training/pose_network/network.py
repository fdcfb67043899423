"""The pose network in PyTorch: an hourglass that predicts every joint and its uncertainty.

Joints are the means of heat maps (soft-argmax; Sun et al., *Integral Human Pose Regression*, ECCV 2018).
Their depths are means of a second map, weighted by the same heat map. In depth images, front and back of a
person look alike. The bottleneck of the hourglass is therefore conditioned on the facing, which the tracker
knows from earlier frames. Without it, the network would average left and right if both are likely.

Only training needs PyTorch. The tracker runs the exported network with ONNX Runtime.
"""

from __future__ import annotations

import torch
from torch import Tensor, nn
from torch.nn.functional import interpolate, relu

from enliven_edge.tracking.estimator.crop import CHANNELS, COLUMNS, ROWS
from enliven_edge.tracking.estimator.labels import FACINGS, PARTS

WIDTHS = (16, 32, 64, 96)
"""Numbers of channels at 1/2, 1/4, 1/8 and 1/16 of the crop's resolution."""
JOINTS = 20
"""Number of joints of a person, in the order of :class:`enliven.person.Joint`."""
USUAL_CELL = 0.027
"""Approximate mean cell size of a crop in metres. It centres the network's input."""
CELL_SPREAD = 0.01
"""Approximate standard deviation in metres of the cell size of a crop. It scales the network's input."""


class PoseNetwork(nn.Module):
    """A network that maps crops and an optional facing to the pose.

    The output consists of joints, their uncertainties, the facing and the body parts.
    """

    def __init__(self, widths: tuple[int, int, int, int] = WIDTHS) -> None:
        super().__init__()
        a, b, c, d = widths
        self.down_2 = nn.Sequential(_make_block(CHANNELS, a, stride=2), _make_block(a, a))
        self.down_4 = nn.Sequential(_make_block(a, b, stride=2), _Residual(b))
        self.down_8 = nn.Sequential(_make_block(b, c, stride=2), _Residual(c), _Residual(c))
        self.waist = nn.Sequential(_make_block(c, d, stride=2), _Residual(d))
        self.facing = nn.Linear(d, FACINGS + 1)
        self.told = nn.Linear(3, d)
        self.mixed = _Residual(d)
        self.to_8, self.up_8 = _make_block(d, c, size=1), _make_block(c, c)
        self.to_4, self.up_4 = _make_block(c, b, size=1), _make_block(b, 2 * b)
        self.maps = nn.Conv2d(2 * b, 3 * JOINTS, 1)
        self.to_2, self.up_2 = _make_block(2 * b, a, size=1), _make_block(a, 2 * a)
        self.parts = nn.Conv2d(2 * a, PARTS, 1)
        self.register_buffer("cells", _cell_positions(ROWS // 4, COLUMNS // 4))

    def forward(self, image: Tensor, told: Tensor) -> tuple[Tensor, Tensor, Tensor, Tensor]:
        """Estimates the pose in N crops.

        Args:
            image: (N, 4, 80, 64) channels as in :class:`enliven_edge.tracking.estimator.crop.Crop`.
            told: (N, 3) condition: cosine and sine of the facing (0 is towards the sensor), both 0 if it is
                unknown, and the cell size in metres.

        Returns:
            Four tensors. The first is (N, 20, 3) joints in crop coordinates in metres. The second is (N, 20)
            logarithms of the expected error of each joint in metres. The third is (N, 9) logits of eight
            facings and of "no person". The fourth is (N, 17, 40, 32) logits of the body parts.
        """
        half = self.down_2(image)
        quarter = self.down_4(half)
        eighth = self.down_8(quarter)
        waist = self.waist(eighth)
        facing = self.facing(waist.mean((2, 3)))
        size = (told[:, 2:] - USUAL_CELL) / CELL_SPREAD
        condition = self.told(torch.cat([told[:, :2], size], 1))
        x = self.mixed(relu(waist + condition[:, :, None, None]))
        x = self.up_8(eighth + _upsampling_layer(self.to_8(x)))
        x = self.up_4(quarter + _upsampling_layer(self.to_4(x)))
        joints, spread = self.decode_maps(self.maps(x).flatten(2).float(), told[:, 2:])
        parts = self.parts(self.up_2(half + _upsampling_layer(self.to_2(x))))
        return joints, spread, facing, parts

    def decode_maps(self, maps: Tensor, cell: Tensor) -> tuple[Tensor, Tensor]:
        """Decodes (N, 20, 3) joints and (N, 20) uncertainties from the (N, 60, cells) maps."""
        heat = torch.softmax(maps[:, :JOINTS], 2)
        flat = (heat @ self.cells) * cell[:, :, None]
        away = (heat * maps[:, JOINTS : 2 * JOINTS]).sum(2)
        spread = (heat * maps[:, 2 * JOINTS :]).sum(2)
        return torch.cat([flat, away[..., None]], 2), spread


class _Residual(nn.Module):
    """Two convolutions with a skip connection."""

    def __init__(self, channels: int) -> None:
        super().__init__()
        last = nn.Conv2d(channels, channels, 3, 1, 1, bias=False)
        self.branch = nn.Sequential(_make_block(channels, channels), last, nn.BatchNorm2d(channels))

    def forward(self, x: Tensor) -> Tensor:
        return relu(x + self.branch(x))


def _make_block(inward: int, outward: int, stride: int = 1, size: int = 3) -> nn.Sequential:
    convolution = nn.Conv2d(inward, outward, size, stride, size // 2, bias=False)
    return nn.Sequential(convolution, nn.BatchNorm2d(outward), nn.ReLU(inplace=True))


def _upsampling_layer(x: Tensor) -> Tensor:
    return interpolate(x, scale_factor=2.0, mode="nearest")


def _cell_positions(rows: int, columns: int) -> Tensor:
    """Returns (rows x columns, 2) positions of a map's cells relative to the middle.

    They point right and down, in cells of the crop.
    """
    down, right = torch.meshgrid(torch.arange(rows), torch.arange(columns), indexing="ij")
    middle = torch.tensor([columns / 2, rows / 2])
    return (torch.stack([right, down], 2).flatten(0, 1) + 0.5 - middle) * (ROWS / rows)
