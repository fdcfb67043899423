"""A mapping: the chains of a take, and the chains of a shape that they drive. Chains are given by joint
names, so a mapping can be stored.

plan = automatic(clip, shape)                  # whole body
plan = read_plan("horse.toml") ... write_plan(plan, path)
project, notes = apply_plan(Project(), shape, clip, plan)
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from enliven.settings import data_field

Mode = Literal["pose", "move"]
Rest = Literal["auto", "zero", "first", "mean"]


@dataclass(frozen=True)
class ChainPlan:
    """A chain of a take, and the chain of a shape that it drives."""

    source: tuple[str, ...] = data_field(
        (),
        "Joints of the take's chain: the first and the last, or all. The first joint stays in "
        "place. A single "
        "joint transfers only its own rotation.",
    )
    target: tuple[str, ...] = data_field(
        (), "Joints of the model's chain: the first and the last, or all. The first joint stays in place."
    )
    role: str = data_field(
        "",
        'Role of the chain, such as "left leg". Chains of one role that continue each other form one '
        "limb and turn about the same axes.",
    )
    mode: Mode = data_field(
        "move",
        '"pose": the model\'s bones point in the directions of the performer\'s bones. "move": the '
        "model's bones keep their rest "
        "pose and add the movement of the performer's bones from their own rest pose.",
    )
    flip: bool = data_field(False, "Rotates the movement by half a turn about the chain's axis.")
    weight: float = data_field(1.0, "Fraction of the movement that is transferred.", low=0.0, high=1.0)
    offset: float = data_field(0.0, "Start time of the take for this chain.", unit="s", low=-3600, high=3600)
    speed: float = data_field(1.0, "Playback speed. Negative values play backwards.", low=-100, high=100)
    loop: bool = data_field(False, "Repeats the take at its end.")
    extend: bool = data_field(False, "Extends the target from its last joint along the longest branch.")
    mirrored: bool = data_field(False, "Mirrors the performer's movement.")
    carries: bool = data_field(
        False,
        "Also moves other branches from the same joints, such as fingers, hair or twist bones, unless "
        "another chain drives them.",
    )


@dataclass(frozen=True)
class Plan:
    """A mapping of a whole take to a whole shape."""

    rest: Rest | float = data_field(
        "auto",
        'Reference pose of the take: "mean", "first", "zero" (rest pose of the file), or a time in '
        'seconds. "auto": a pose with hanging limbs for two-legged performers, otherwise "mean".',
    )
    turn: bool = data_field(
        True, "Turns the whole model with the performer. Chains that drive only the model's root do this."
    )
    travel: bool = data_field(False, "Moves the whole model through the world with the performer.")
    level: bool = data_field(
        False, "Keeps the model upright: the whole model follows only the performer's heading."
    )
    floor: bool = data_field(True, "Keeps the lowest point of a standing model on the floor.")
    steps: bool = data_field(
        True,
        "Makes legs that are not posed directly follow the steps of the performer's feet. Needs `floor`.",
    )
    stretch: bool = data_field(
        False,
        "Also transfers changes of bone length, scaled to the model's size. Clips of the model itself "
        "always do this.",
    )
    limits: bool = data_field(
        True,
        "Keeps joints within the ranges of the model's own clips plus a margin, or within a wide cone "
        "without clips. Models built like the performer are exempt.",
    )
    stride: float = data_field(
        1.0,
        "Length of steps and travel, relative to the performer's strides scaled to the model's size.",
        low=0.0,
        high=10.0,
    )
    pin: bool = data_field(False, "Locks feet that stand still (foot lock). Needs `travel`.")
    take_facing: float | None = data_field(
        None,
        "Initial heading of the performer, from +Z to the left. None: detected automatically.",
        unit="deg",
    )
    model_facing: float | None = data_field(
        None, "Heading of the model, from +Z to its left. None: detected automatically.", unit="deg"
    )
    chains: tuple[ChainPlan, ...] = data_field((), "Chains of the take and the model chains that they drive.")
