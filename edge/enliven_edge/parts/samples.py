"""The forest's food: pictures cut to their person, and pixels drawn from them part by part."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from enliven.arrays import AnyArray, Float, UInt8, UInt16
from enliven_edge.parts.features import millimetres
from enliven_edge.parts.labels import NOBODY, PARTS
from enliven_edge.parts.pictures import Picture


@dataclass(frozen=True)
class Album:
    """Pictures one after another.

    Attributes:
        pixels: (N,) uint16 millimetres, 0 off the person and on a border of one pixel around it.
        labels: (N,) the part of every pixel.
        boxes: (I, 3) int64 where each picture begins, its height and its width.
        focal: (I, 2) pixels, across and down.
    """

    pixels: UInt16
    labels: UInt8
    boxes: AnyArray
    focal: Float

    def draw(self, each: int, dice: np.random.Generator) -> tuple[AnyArray, UInt8]:
        """At most ``each`` pixels of a part from every picture: (M, 3) picture, row, column; (M,) part."""
        places, parts = [], []
        for picture, (start, height, width) in enumerate(self.boxes):
            labels = self.labels[start : start + height * width]
            for part in range(PARTS):
                found = np.flatnonzero(labels == part)
                if len(found) > each:
                    found = np.sort(dice.choice(found, each, replace=False))
                row, column = np.divmod(found, width)
                places.append(np.stack([np.full(len(found), picture), row, column], 1))
                parts.append(np.full(len(found), part, np.uint8))
        return np.concatenate(places).astype(np.int32), np.concatenate(parts)


def collect(pictures: Iterator[Picture]) -> Album:
    """The album of some pictures."""
    pixels, labels, boxes, focal, start = [], [], [], [], 0
    for picture in pictures:
        rows = np.flatnonzero((picture.z > 0).any(1))
        columns = np.flatnonzero((picture.z > 0).any(0))
        box = np.s_[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
        z, label = picture.z[box], np.where(picture.z[box] > 0, picture.label[box], NOBODY)
        bordered = millimetres(z)
        pixels.append(bordered.ravel())
        labels.append(np.pad(label.astype(np.uint8), 1, constant_values=NOBODY).ravel())
        boxes.append((start, *bordered.shape))
        focal.append(picture.camera[:2])
        start += bordered.size
    return Album(np.concatenate(pixels), np.concatenate(labels), np.array(boxes), np.array(focal))
