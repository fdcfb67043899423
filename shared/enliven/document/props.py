"""Props: the loose boxes and balls of a scene, which are not attached to a performer."""

from __future__ import annotations

from dataclasses import dataclass

from enliven.arrays import Float, Float32, Int, UInt8

BOX = 0
"""The number of a box in ``Props.shapes`` and in the network protocol."""
BALL = 1
"""The number of a ball in ``Props.shapes`` and in the network protocol."""


@dataclass(frozen=True)
class Props:
    """All P loose objects at one moment.

    Attributes:
        time_ns: the sensor's clock.
        ids: (P,) stable while the object exists.
        shapes: (P,) uint8, BOX or BALL.
        sizes: (P, 3) float32 metres: half edges of a box, the radius three times for a ball.
        colours: (P, 3) uint8 sRGB.
        positions: (P, 3) metres, world frame.
        turns: (P, 4) unit quaternions (w, x, y, z), world_from_prop.
        note: one line of text for the users, such as the score; or empty.
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
