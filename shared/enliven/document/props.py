"""Props: the loose boxes and balls of a scene, which no performer holds."""

from __future__ import annotations

from dataclasses import dataclass

from enliven.arrays import Float, Float32, Int, UInt8

BOX = 0
"""The number of a box in ``Props.shapes``, as on the wire."""
BALL = 1
"""The number of a ball in ``Props.shapes``, as on the wire."""


@dataclass(frozen=True)
class Props:
    """Everything loose at one moment, P things.

    Attributes:
        time_ns: the sensor's clock.
        ids: (P,) stable while the thing exists.
        shapes: (P,) uint8, BOX or BALL.
        sizes: (P, 3) float32 metres: half edges of a box, the radius three times for a ball.
        colours: (P, 3) uint8 sRGB.
        positions: (P, 3) metres, world frame.
        turns: (P, 4) unit quaternions (w, x, y, z), world_from_prop.
        note: one line for people, such as the score; or empty.
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
