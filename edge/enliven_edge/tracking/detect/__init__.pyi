from .appearance import Seen, facing, looked_at, turned_about
from .detection import cost, detect, detect_another, quality, supposing
from .facing_side import Facing
from .posing import drawn
from .recovery import SecondThoughts

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
