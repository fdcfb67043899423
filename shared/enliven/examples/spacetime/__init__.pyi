from .anchoring import stand
from .bounded import Nodes
from .constraints import Conditions, conditions_of
from .locomotion import PlacedMotion, check_switches, find_switches, locate, standing_feet
from .nearest import Nearest
from .planting import planted
from .spacetime import Solution, solve

__all__ = [
    "Conditions",
    "Nearest",
    "Nodes",
    "PlacedMotion",
    "Solution",
    "check_switches",
    "conditions_of",
    "find_switches",
    "locate",
    "planted",
    "solve",
    "stand",
    "standing_feet",
]
