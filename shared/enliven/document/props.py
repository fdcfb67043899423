"""Props: boxes and balls in a scene that move independently of the performers."""

from __future__ import annotations

from dataclasses import dataclass

from enliven.arrays import Float, Float32, Int, UInt8

BOX = 0
"""The number of a box in ``Props.shapes`` and in the network protocol."""
BALL = 1
"""The number of a ball in ``Props.shapes`` and in the network protocol."""


@dataclass(frozen=True)
class Props:
    """All P props at one time.

    Attributes:
        time_ns: time of the sensor's clock, nanoseconds.
        ids: (P,) ids that stay the same while an object exists.
        shapes: (P,) uint8, BOX or BALL.
        sizes: (P, 3) float32 metres: the half edge lengths of a box, or the radius of a ball in all three
            columns.
        colours: (P, 3) uint8 sRGB.
        positions: (P, 3) metres, world frame.
        turns: (P, 4) unit quaternions (w, x, y, z), the rotations from prop to world.
        note: one line of text for users, such as a score. May be empty.
    """

    time_ns: int
    ids: Int
    shapes: UInt8
    sizes: Float32
    colours: UInt8
    positions: Float
    turns: Float
    note: str = ""

    def __len__(self) -> int:
        return len(self.ids)
