"""Detection of a posture without the frame before: hypotheses from extremities and the network, judged by
fits.
"""

from enliven_edge.tracking.detect.appearance import Seen, facing, looked_at, turned_about
from enliven_edge.tracking.detect.detection import cost, detect, detect_another, quality, supposing
from enliven_edge.tracking.detect.facing_side import Facing
from enliven_edge.tracking.detect.posing import drawn
from enliven_edge.tracking.detect.recovery import SecondThoughts

__all__ = [
    "Facing",
    "SecondThoughts",
    "Seen",
    "cost",
    "detect",
    "detect_another",
    "drawn",
    "facing",
    "looked_at",
    "quality",
    "supposing",
    "turned_about",
]
