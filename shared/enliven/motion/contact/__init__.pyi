from .contacts import Contacts, hold, runs_of, touching
from .pin import bend_of, held_pins, local_turns, pin_feet, rebuild, unpin
from .standing import Standing, standing_of, window_of

__all__ = [
    "Contacts",
    "Standing",
    "bend_of",
    "held_pins",
    "hold",
    "local_turns",
    "pin_feet",
    "rebuild",
    "runs_of",
    "standing_of",
    "touching",
    "unpin",
    "window_of",
]
