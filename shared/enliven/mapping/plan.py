"""A mapping: which chains of a take drive which chains of a shape, and how; by names, so that it can be kept.

plan = automatic(clip, shape)                  # whole body
plan = read_plan("horse.toml") ... write_plan(plan, path)
project, notes = apply_plan(Project(), shape, clip, plan)
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from enliven.settings import setting

Mode = Literal["pose", "move"]
Rest = Literal["auto", "zero", "first", "mean"]


@dataclass(frozen=True)
class ChainPlan:
    """One chain of a take and the one of a shape that it drives."""

    source: tuple[str, ...] = setting(
        (), "Joints of the take: first and last, or all; the first stays. One joint is the turn of itself."
    )
    target: tuple[str, ...] = setting((), "Joints of the model, in the same way; the first stays.")
    role: str = setting("", "What it is; only for whoever reads the file.")
    mode: Mode = setting(
        "move",
        '"pose": the model\'s bones point where the performer\'s do; "move": they keep their own rest pose '
        "and are moved from it as the performer's move from theirs.",
    )
    flip: bool = setting(False, "Turn the movement half round the chain.")
    weight: float = setting(1.0, "How much of the movement is taken.", low=0.0, high=1.0)
    offset: float = setting(0.0, "When the take begins for this chain.", unit="s", low=-3600, high=3600)
    speed: float = setting(1.0, "How fast it plays; below 0 backwards.", low=-100, high=100)
    loop: bool = setting(False, "Begin again at the end.")
    extend: bool = setting(False, "Go on from the last joint of the target along its longest branch.")
    mirrored: bool = setting(False, "Take the performer as seen in a mirror.")
    carries: bool = setting(
        False,
        "Move everything else that begins at the same joints along, unless a chain drives it: fingers, hair, "
        "twist bones.",
    )


@dataclass(frozen=True)
class Plan:
    """A mapping of a whole take to a whole shape."""

    rest: Rest | float = setting(
        "auto",
        'The pose of the take that movement is counted from: "mean", "first", "zero" (the file\'s own), '
        'seconds into it, or "auto": of the two-legged the frames in which their limbs hang, else the mean.',
    )
    turn: bool = setting(True, "Turn the whole model as the performer turns: chains onto its root alone.")
    travel: bool = setting(False, "Move the whole model as the performer moves.")
    level: bool = setting(False, "Keep the model level: its whole turns as the performer heads, and no more.")
    floor: bool = setting(True, "Keep what stands on the floor, by its lowest point.")
    steps: bool = setting(
        True, "Let legs that are not posed as the performer's step as theirs do, by their feet (with floor)."
    )
    stretch: bool = setting(
        False,
        "Lengthen and stretch the model's bones as the take does its own, in the model's size. A clip of the "
        "model itself always does.",
    )
    limits: bool = setting(
        True,
        "Keep the joints of a model that is not built as the performer within what its own clips show, and a "
        "margin; of one without clips within a wide cone about its rest pose.",
    )
    stride: float = setting(
        1.0, "How far it steps and travels, in the performer's strides at its own size.", low=0.0, high=10.0
    )
    pin: bool = setting(False, "Hold feet where they stand while they do not move (with travel).")
    take_facing: float | None = setting(
        None, "Where the performer looks at first, from +Z to the left; found where not given.", unit="deg"
    )
    model_facing: float | None = setting(
        None, "Where the model looks, from +Z to its left; found where not given.", unit="deg"
    )
    chains: tuple[ChainPlan, ...] = setting((), "What drives what.")
