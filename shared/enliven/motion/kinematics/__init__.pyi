from .composing import compose, own_turns, upright
from .ik import two_bone
from .quaternions import between, conj, load, mul, store, turn
from .reaching import reach
from .vectors import about, cross, dot, length, minus, row, swing_to

__all__ = [
    "about",
    "between",
    "compose",
    "conj",
    "cross",
    "dot",
    "length",
    "load",
    "minus",
    "mul",
    "own_turns",
    "reach",
    "row",
    "store",
    "swing_to",
    "turn",
    "two_bone",
    "upright",
]
