"""What the network learns from: crops of people that the project makes up, with the truth beside them.

People of all builds in all postures before all sensors, and what a tracker does wrong in handing over their
pixels: the middle a little off, a limb given to somebody else, a piece of something else taken in.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from enliven.arrays import Bool, Float32, UInt8
from enliven.person import Limb
from enliven_edge.tracking.estimator import COLUMNS, NOBODY, ROWS, BodyPart, Crop, crop_person, facing_of
from enliven_synthesis.training.rendering import Picture, Studio

Dice = np.random.Generator

LABEL_ROWS, LABEL_COLUMNS = ROWS // 2, COLUMNS // 2
_MISPLACED = np.array([0.05, 0.05, 0.06, 0.06])
"""Metres, one deviation, by which a crop's middle is off, and the logarithm by which its size is."""
_FLOOR_OFF = 0.02
"""Metres, one deviation, by which the floor is off;"""
_IN_THE_AIR, _HIGHEST = 0.1, 0.6
"""and the share of pictures in which people jump, or stand on something, and how high at most."""
_LOST = (
    BodyPart.HAND_LEFT,
    BodyPart.FOREARM_LEFT,
    BodyPart.UPPER_ARM_LEFT,
    BodyPart.FOOT_LEFT,
    BodyPart.SHANK_LEFT,
    BodyPart.HEAD,
)
_THINGS = 0.12
"""Share of the lessons that are about no person."""
_LOSES, _TAKES_IN, _SHREDS = 0.1, 0.1, 0.03
"""Shares of the pictures in which a limb is lost, in which something else is taken for the person, and in
which nothing is measured but here and there."""


@dataclass(frozen=True)
class Lesson:
    """One crop and the truth.

    Attributes:
        image: (4, 80, 64) float32, as of :class:`Crop`.
        cell: metres a cell.
        joints: (20, 3) float32 metres, crop coordinates, ordered by :class:`enliven.person.body.Joint`.
        facing: radians, as of :func:`facing_of`; not a number where it is no person, and joints are 0.
        parts: (40, 32) uint8 the part seen at every second cell, NOBODY where none is.
    """

    image: Float32
    cell: float
    joints: Float32
    facing: float
    parts: UInt8


def lesson(studio: Studio, dice: Dice, frontal: float) -> Lesson:
    """A lesson about somebody, or something; ``frontal`` is the share of people who look at the sensor."""
    thing = dice.random() < _THINGS
    picture = studio.thing(dice) if thing else studio.picture(dice, frontal=frontal)
    mask = picture.z > 0
    z = np.where(mask, picture.z, picture.around)
    if not thing and dice.random() < _LOSES:
        mask &= ~_lost_limb(picture, dice)
    if not mask.any():
        return lesson(studio, dice, frontal)
    if dice.random() < _TAKES_IN:
        z, mask = _taken_in(z, mask, dice)
    if dice.random() < _SHREDS:
        shreds = _shreds(mask, dice)
        z, mask = np.where(shreds, z, 0.0).astype(np.float32), mask & shreds
    raised = dice.normal(0.0, _FLOOR_OFF)
    if dice.random() < _IN_THE_AIR:
        raised += dice.uniform(0.0, _HIGHEST)
    shift = dice.normal(0.0, 1.0, 4) * _MISPLACED
    pose = picture.world_from_camera
    crop = crop_person(z.astype(np.float64), mask, picture.camera, pose, shift, raised)
    if picture.figure is None:
        nothing = np.full((LABEL_ROWS, LABEL_COLUMNS), NOBODY, np.uint8)
        return Lesson(crop.image, crop.cell, np.zeros((20, 3), np.float32), np.nan, nothing)
    inverse = np.linalg.inv(pose)
    joints = picture.figure.joints @ inverse[:3, :3].T + inverse[:3, 3]
    chest = picture.figure.frames[Limb.CHEST]
    return Lesson(
        crop.image,
        crop.cell,
        crop.from_camera(joints).astype(np.float32),
        facing_of(chest[:, 0], chest[:, 3], pose[:3, 3]),
        _labels(crop, picture, mask),
    )


def _lost_limb(picture: Picture, dice: Dice) -> Bool:
    """(h, w) the pixels of one part of the body."""
    part = int(_LOST[int(dice.integers(len(_LOST)))])
    return np.asarray(picture.label == (part if part == BodyPart.HEAD else part + int(dice.integers(2))))


def _shreds(mask: Bool, dice: Dice) -> Bool:
    """(h, w) discs here and there on the person."""
    rows, columns = np.nonzero(mask)
    reach = max(1.0, 0.04 * float(np.hypot(np.ptp(rows), np.ptp(columns))) * dice.uniform(0.6, 1.6))
    v, u = np.indices(mask.shape)
    out = np.zeros(mask.shape, bool)
    for i in dice.integers(0, len(rows), int(dice.integers(15, 50))):
        out |= (v - rows[i]) ** 2 + (u - columns[i]) ** 2 < reach**2
    return out


def _taken_in(z: Float32, mask: Bool, dice: Dice) -> tuple[Float32, Bool]:
    """The depth and the person's pixels with a slanted piece of something beside or before them."""
    rows, columns = np.nonzero(mask)
    i = int(dice.integers(len(rows)))
    sides = (int(np.ptp(rows)) + 5, int(np.ptp(columns)) + 5)
    tall, wide = (int(dice.integers(3, max(4, side // 4))) for side in sides)
    top = max(0, rows[i] - int(dice.integers(tall)))
    left = max(0, columns[i] - int(dice.integers(wide)))
    piece = np.zeros(mask.shape, bool)
    piece[top : top + tall, left : left + wide] = True
    if dice.random() < 0.7:
        piece &= ~mask
    down, right = np.nonzero(piece)
    out, taken = z.copy(), mask | piece
    slope = dice.normal(0.0, 0.01, 2)
    here = float(z[rows[i], columns[i]]) + dice.normal(0.0, 0.1)
    out[piece] = np.maximum(0.3, here + slope[0] * (down - top) + slope[1] * (right - left))
    return out, taken


def _labels(crop: Crop, picture: Picture, mask: Bool) -> UInt8:
    """(40, 32) the part in the middle of every two by two cells."""
    i, j = np.mgrid[:LABEL_ROWS, :LABEL_COLUMNS]
    flat = np.stack([(j + 0.5 - LABEL_COLUMNS / 2), (i + 0.5 - LABEL_ROWS / 2)], -1) * (2 * crop.cell)
    x, y = np.moveaxis((flat / crop.depth + crop.centre) @ crop.axes, -1, 0)
    u = np.floor(picture.camera[0] * x + picture.camera[2] + 0.5).astype(int)
    v = np.floor(picture.camera[1] * y + picture.camera[3] + 0.5).astype(int)
    height, width = mask.shape
    inside = (u >= 0) & (v >= 0) & (u < width) & (v < height)
    out = np.full((LABEL_ROWS, LABEL_COLUMNS), NOBODY, np.uint8)
    out[inside] = np.where(mask, picture.label, NOBODY)[v[inside], u[inside]]
    return out
