"""Compiled kinematics: quaternions, vectors, and inverse kinematics of limbs and chains."""

from enliven.motion.kinematics.composing import compose, own_turns, upright
from enliven.motion.kinematics.ik import two_bone
from enliven.motion.kinematics.quaternions import between, conj, load, mul, store, turn
from enliven.motion.kinematics.reaching import reach
from enliven.motion.kinematics.vectors import about, cross, dot, length, minus, row, swing_to

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
