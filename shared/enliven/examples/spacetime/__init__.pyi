from .anchoring import stand as stand
from .bounded import Nodes as Nodes
from .constraints import Conditions as Conditions, convert_constraints as convert_constraints
from .following import (
    PathFollower as PathFollower,
    floor_positions as floor_positions,
    floor_numbers as floor_numbers,
)
from .locomotion import (
    PlacedMotion as PlacedMotion,
    check_switches as check_switches,
    find_switches as find_switches,
    place_motion as place_motion,
    standing_feet as standing_feet,
)
from .nearest import Nearest as Nearest
from .planting import lock_feet as lock_feet
from .spacetime import Solution as Solution, solve as solve
