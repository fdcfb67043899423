"""Spacetime trajectories: a banded least-squares problem over all frames, with hard constraints and
locomotion.
"""

from enliven.examples.spacetime.anchoring import stand
from enliven.examples.spacetime.bounded import Nodes
from enliven.examples.spacetime.constraints import Conditions, conditions_of
from enliven.examples.spacetime.locomotion import Placed, check_switches, find_switches, locate, standing_feet
from enliven.examples.spacetime.nearest import Nearest
from enliven.examples.spacetime.planting import planted
from enliven.examples.spacetime.spacetime import Solution, solve

__all__ = [
    "Conditions",
    "Nearest",
    "Nodes",
    "Placed",
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
