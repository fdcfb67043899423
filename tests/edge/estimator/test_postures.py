"""Tests of random postures: each family of postures has its defining property."""

from __future__ import annotations

import numpy as np
import pytest

from enliven.person import Limb
from enliven.person.joints import Joint
from enliven_synthesis.body.performer import Figure, Performer
from enliven_synthesis.training.arm_poses import HOLDS, is_inside_trunk
from enliven_synthesis.training.body_poses import FAMILIES, random_figure
from enliven_synthesis.training.close_arms import CLOSE_HOLDS
from enliven_synthesis.training.rendering import random_build

WRISTS = [Joint.WRIST_LEFT, Joint.WRIST_RIGHT]
ANKLES = [Joint.ANKLE_LEFT, Joint.ANKLE_RIGHT]


def figures(family: str, count: int = 60, arms: str | None = None) -> list[Figure]:
    """Returns ``count`` figures of a family, of random builds."""
    return [figure for _, figure in performers(family, count, arms)]


def performers(family: str, count: int, arms: str | None) -> list[tuple[Performer, Figure]]:
    """Returns ``count`` people with random builds, each with a figure of the family."""
    pairs = []
    for seed in range(count):
        dice = np.random.default_rng([7, seed])
        performer = Performer(random_build(dice))
        pairs.append((performer, random_figure(performer, dice, dice.uniform(-3, 3), family, arms)))
    return pairs


def wrists_of_chest(performer: Performer, figure: Figure) -> np.ndarray:
    """Returns (2, 3) wrist positions in the chest's frame, scaled to a person of 1.75 m, metres: outward, up,
    ahead.
    """
    chest = figure.frames[Limb.CHEST]
    local = (figure.joints[WRISTS] - chest[:, 3]) @ chest[:, :3] / performer.scale
    return local * np.array([[1.0, 1.0, 1.0], [-1.0, 1.0, 1.0]])


def test_a_high_leg_is_high_while_the_other_stands():
    """The standing foot is almost flat: its ankle is a hand's width above the floor."""
    ankles = np.array([figure.joints[ANKLES, 1] for figure in figures("high leg")])
    assert (ankles.min(1) < 0.13).all() and (ankles.min(1) > 0.0).all()
    assert np.mean(ankles.max(1) > 0.25) > 0.7
    assert ankles.max() > 0.8, "as high as the hips, sometimes"


def test_either_leg_is_the_high_one_and_the_trunk_leans_away_from_it():
    high, leaning = figures("high leg"), []
    left = np.array([figure.joints[ANKLES, 1].argmax() == 0 for figure in high])
    assert 0.3 < left.mean() < 0.7
    for figure, is_left in zip(high, left, strict=True):
        hips = figure.joints[Joint.HIP_LEFT] - figure.joints[Joint.HIP_RIGHT]
        raised, stands = figure.joints[ANKLES][:: 1 if is_left else -1]
        outward = hips if is_left else -hips
        assert (raised - stands) @ outward > 0.0
        leaning.append(
            (figure.joints[Joint.HEAD] - figure.joints[Joint.HIP_CENTER])[[0, 2]] @ outward[[0, 2]]
        )
    assert np.mean(np.array(leaning) < 0.0) > 0.8


@pytest.mark.parametrize("family", FAMILIES)
def test_lowest_joint_of_random_figures_is_at_the_floor(family):
    for figure in figures(family, 12):
        assert -0.06 < figure.joints[:, 1].min() < 0.2


@pytest.mark.parametrize("hold", HOLDS)
def test_no_arm_is_inside_the_trunk_or_the_head(hold):
    for performer, figure in performers("stand", 8, hold):
        rotations = figure.frames[:, :, :3]
        assert not any(is_inside_trunk(performer, rotations, side) for side in (0, 1))


@pytest.mark.parametrize("hold", CLOSE_HOLDS)
def test_arms_held_close_are_near_the_trunk_or_ahead_of_it(hold):
    """In nearly all people, no wrist is an arm's length to the side. An arm that cannot be close is held
    out.
    """
    near = [np.abs(wrists_of_chest(*pair)[:, 0]).max() < 0.45 for pair in performers("stand", 20, hold)]
    assert np.mean(near) > 0.8


@pytest.mark.parametrize("hold", ["folded", "belly", "chin", "guard"])
def test_wrists_are_before_the_trunk_of_everybody(hold):
    ahead = [wrists_of_chest(*pair)[:, 2].min() > 0.08 for pair in performers("stand", 20, hold)]
    assert np.mean(ahead) > 0.8


def test_person_sitting_down_leans_forward_over_bent_knees():
    for figure in figures("sit down", 20):
        hips, head = figure.joints[Joint.HIP_CENTER], figure.joints[Joint.HEAD]
        ahead = figure.frames[Limb.PELVIS][[0, 2], 2]
        assert (head - hips)[[0, 2]] @ ahead > 0.05
        assert hips[1] < 0.92 * (np.linalg.norm(hips - head) + 0.5)
