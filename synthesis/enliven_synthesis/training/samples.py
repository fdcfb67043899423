"""Training samples: crops of synthetic people with the ground truth.

They show people of all builds in all postures in front of all sensors, with the typical faults of a tracker's
masks: a displaced centre, a missing limb, or pixels of another object or of a wall.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.random import Generator
from scipy.ndimage import distance_transform_edt

from enliven.arrays import Bool, Float, Float32, UInt8
from enliven.person import Limb
from enliven_edge.tracking.estimator.crop import COLUMNS, ROWS, Crop, crop_person
from enliven_edge.tracking.estimator.labels import NOBODY, BodyPart, facing_in_plan
from enliven_synthesis.training.rendering import PersonRenderer, RenderedPerson

LABEL_ROWS, LABEL_COLUMNS = ROWS // 2, COLUMNS // 2
"""Rows and columns of the part labels. They are half the crop's resolution, which is the network's output
resolution."""
_CROP_DEVIATIONS = np.array([0.05, 0.05, 0.06, 0.06])
"""Standard deviations of a crop's errors, similar to those of a tracker.

Three are for the position in metres, and one for the logarithm of the size."""
_FLOOR_ERROR_M = 0.02
"""Standard deviation in metres of the error of the floor's height, similar to that of a tracker."""
_JUMP_FRACTION = 0.1
"""Fraction of samples in which people jump, or stand on an object."""
_MAX_JUMP_HEIGHT_M = 0.6
"""Maximum height in metres at which people jump or stand above the floor: a high jump, or a chair."""
_LOSABLE_PARTS = (
    BodyPart.HAND_LEFT,
    BodyPart.FOREARM_LEFT,
    BodyPart.UPPER_ARM_LEFT,
    BodyPart.FOOT_LEFT,
    BodyPart.SHANK_LEFT,
    BodyPart.HEAD,
)
"""Body parts that a tracker may lose: the head, and parts of the left side.

The parts of the left side represent both sides."""
CLUTTER_FRACTION = 0.12
"""Fraction of samples without a person: one in eight."""
_LOST_LIMB_FRACTION = 0.1
"""Fraction of samples in which a limb is lost."""
_FOREIGN_PIECE_FRACTION = 0.1
"""Fraction of samples in which a piece of another object is assigned to the person."""
_WALL_PIECE_FRACTION = 0.12
"""Fraction of samples in which the wall next to the person is assigned to the person. If the person is close
to the wall, the depth has no step there."""
_WALL_DISTANCES_M = (0.0, 0.6)
"""Minimum and maximum distance in metres of such a wall behind the person's middle."""
_WALL_SLOPE = 0.006
"""Standard deviation of the slope of such a wall in metres per pixel. It is about 30 degrees."""
_WALL_REST_FRACTION = 0.3
"""Fraction of the samples without a person who show a piece of a wall next to a person. The piece ends at
the person, so it has a person's outline and height."""
_STRAIGHT_EDGE_FRACTION = 0.6
"""Fraction of these pieces that end at a straight edge, such as a door's, on the other side."""
_MIN_WALL_PIXELS = 60
"""Minimum number of pixels of such a piece of wall. The tracker ignores smaller blobs."""
_SHREDDED_FRACTION = 0.03
"""Fraction of samples in which depth is measured only in small discs."""


@dataclass(frozen=True)
class TrainingSample:
    """One crop with its ground truth.

    Attributes:
        image: (4, 80, 64) float32, channels as in :class:`Crop`.
        cell: size of a cell in metres.
        joints: (20, 3) float32 metres, crop coordinates, ordered by :class:`enliven.person.body.Joint`.
        facing: radians, as returned by :func:`facing_in_plan`. Without a person it is NaN, and the joints are
            0.
        parts: (40, 32) uint8 the body part at every second cell, or the background label.
    """

    image: Float32
    cell: float
    joints: Float32
    facing: float
    parts: UInt8


def training_sample(renderer: PersonRenderer, rng: Generator, frontal: float) -> TrainingSample:
    """Renders a random sample; ``frontal`` is the fraction of people who face the sensor."""
    clutter = rng.random() < CLUTTER_FRACTION
    is_wall_rest = clutter and rng.random() < _WALL_REST_FRACTION
    if is_wall_rest or not clutter:
        rendered = renderer.render_person(rng, frontal=frontal)
    else:
        rendered = renderer.render_clutter(rng)
    mask = rendered.z > 0
    z = np.where(mask, rendered.z, rendered.around)
    if is_wall_rest:
        z, mask = add_wall_alone(z, mask, rng)
    elif not clutter and rng.random() < _LOST_LIMB_FRACTION:
        mask &= ~_draw_lost_limb(rendered, rng)
    if mask.sum() < (_MIN_WALL_PIXELS if is_wall_rest else 1):
        return training_sample(renderer, rng, frontal)
    if rng.random() < _FOREIGN_PIECE_FRACTION:
        z, mask = _add_foreign_piece(z, mask, rng)
    if not is_wall_rest and rng.random() < _WALL_PIECE_FRACTION:
        z, mask = add_wall(z, mask, rng)
    if rng.random() < _SHREDDED_FRACTION:
        shreds = _draw_discs(mask, rng)
        z, mask = np.where(shreds, z, 0.0).astype(np.float32), mask & shreds
    raised = rng.normal(0.0, _FLOOR_ERROR_M)
    if rng.random() < _JUMP_FRACTION:
        raised += rng.uniform(0.0, _MAX_JUMP_HEIGHT_M)
    shift = rng.normal(0.0, 1.0, 4) * _CROP_DEVIATIONS
    pose = rendered.world_from_camera
    crop = crop_person(z.astype(np.float64), mask, rendered.camera, pose, shift, raised)
    if rendered.figure is None or is_wall_rest:
        nothing = np.full((LABEL_ROWS, LABEL_COLUMNS), NOBODY, np.uint8)
        return TrainingSample(crop.image, crop.cell, np.zeros((20, 3), np.float32), np.nan, nothing)
    inverse = np.linalg.inv(pose)
    joints = rendered.figure.joints @ inverse[:3, :3].T + inverse[:3, 3]
    chest = rendered.figure.frames[Limb.CHEST]
    return TrainingSample(
        crop.image,
        crop.cell,
        crop_coordinates(crop, joints).astype(np.float32),
        facing_in_plan(chest[:, 0], chest[:, 3], pose[:3, 3]),
        _label_crop(crop, rendered, mask),
    )


def _draw_lost_limb(rendered: RenderedPerson, rng: Generator) -> Bool:
    """Returns the pixels (h, w) of a random part of the body."""
    part = int(_LOSABLE_PARTS[int(rng.integers(len(_LOSABLE_PARTS)))])
    return np.asarray(rendered.label == (part if part == BodyPart.HEAD else part + int(rng.integers(2))))


def _draw_discs(mask: Bool, rng: Generator) -> Bool:
    """Returns (h, w) small random discs on the person."""
    rows, columns = np.nonzero(mask)
    reach = max(1.0, 0.04 * float(np.hypot(np.ptp(rows), np.ptp(columns))) * rng.uniform(0.6, 1.6))
    v, u = np.indices(mask.shape)
    out = np.zeros(mask.shape, bool)
    for i in rng.integers(0, len(rows), int(rng.integers(15, 50))):
        out |= (v - rows[i]) ** 2 + (u - columns[i]) ** 2 < reach**2
    return out


def _add_foreign_piece(z: Float32, mask: Bool, rng: Generator) -> tuple[Float32, Bool]:
    """Adds a slanted piece of another object to the depth and to the person's mask, both (h, w)."""
    rows, columns = np.nonzero(mask)
    i = int(rng.integers(len(rows)))
    sides = (int(np.ptp(rows)) + 5, int(np.ptp(columns)) + 5)
    height, width = (int(rng.integers(3, max(4, side // 4))) for side in sides)
    top = max(0, rows[i] - int(rng.integers(height)))
    left = max(0, columns[i] - int(rng.integers(width)))
    piece = np.zeros(mask.shape, bool)
    piece[top : top + height, left : left + width] = True
    if rng.random() < 0.7:
        piece &= ~mask
    down, right = np.nonzero(piece)
    out, new_mask = z.copy(), mask | piece
    slope = rng.normal(0.0, 0.01, 2)
    depth = float(z[rows[i], columns[i]]) + rng.normal(0.0, 0.1)
    out[piece] = np.maximum(0.3, depth + slope[0] * (down - top) + slope[1] * (right - left))
    return out, new_mask


def add_wall(z: Float32, mask: Bool, rng: Generator) -> tuple[Float32, Bool]:
    """Adds the wall next to the person to the depth and to the person's mask, both (h, w)."""
    rows, columns = np.nonzero(mask)
    i = int(rng.integers(len(rows)))
    v, u = np.indices(mask.shape)
    down, right = v - rows[i], u - columns[i]
    direction = rng.normal(0.0, 0.5) + np.pi * int(rng.integers(2))  # Angle from the horizontal.
    reach = rng.uniform(0.03, 0.4) * (float(np.ptp(rows)) + 5.0)
    piece = (right * np.cos(direction) + down * np.sin(direction) > 0) & ~mask
    piece &= distance_transform_edt(~mask) < reach
    slope = rng.normal(0.0, _WALL_SLOPE, 2)
    wall = float(np.median(z[mask])) + rng.uniform(*_WALL_DISTANCES_M) + slope[0] * down + slope[1] * right
    out = z.copy()
    out[piece] = np.maximum(0.3, wall[piece])
    return out, mask | piece


def add_wall_alone(z: Float32, mask: Bool, rng: Generator) -> tuple[Float32, Bool]:
    """Adds the wall next to the person to the (h, w) depth. Returns the depth with a mask of the wall
    alone.
    """
    out, new_mask = add_wall(z, mask, rng)
    piece = new_mask & ~mask
    if piece.any() and rng.random() < _STRAIGHT_EDGE_FRACTION:
        v, u = np.indices(mask.shape)
        slope = rng.normal(0.0, 0.05)  # Slope of the edge, in columns per row.
        wall_depth = u + slope * (v - 0.5 * len(mask))
        beyond = wall_depth > rng.uniform(*np.quantile(wall_depth[piece], (0.2, 0.8)))
        piece &= beyond if rng.random() < 0.5 else ~beyond
    return out, piece


def _label_crop(crop: Crop, rendered: RenderedPerson, mask: Bool) -> UInt8:
    """Returns the body part (40, 32) at the centre of every block of 2 x 2 cells."""
    i, j = np.mgrid[:LABEL_ROWS, :LABEL_COLUMNS]
    flat = np.stack([(j + 0.5 - LABEL_COLUMNS / 2), (i + 0.5 - LABEL_ROWS / 2)], -1) * (2 * crop.cell)
    x, y = np.moveaxis((flat / crop.depth + crop.centre) @ crop.axes, -1, 0)
    u = np.floor(rendered.camera[0] * x + rendered.camera[2] + 0.5).astype(int)
    v = np.floor(rendered.camera[1] * y + rendered.camera[3] + 0.5).astype(int)
    height, width = mask.shape
    inside = (u >= 0) & (v >= 0) & (u < width) & (v < height)
    out = np.full((LABEL_ROWS, LABEL_COLUMNS), NOBODY, np.uint8)
    out[inside] = np.where(mask, rendered.label, NOBODY)[v[inside], u[inside]]
    return out


def crop_coordinates(crop: Crop, points: Float) -> Float:
    """Converts (N, 3) points in the camera's frame (x right, y down, z ahead) to (N, 3) crop coordinates."""
    flat = (points[:, :2] / points[:, 2:] @ crop.axes.T - crop.centre) * crop.depth
    return np.concatenate([flat, points[:, 2:] - crop.depth], 1)
