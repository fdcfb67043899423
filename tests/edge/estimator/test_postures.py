"""Postures by dice: what a family of them is."""

from __future__ import annotations

import numpy as np
import pytest

from enliven.person.joints import Joint
from enliven_synthesis.body.performer import Figure, Performer
from enliven_synthesis.training.body_poses import FAMILIES, random_figure
from enliven_synthesis.training.rendering import random_build

ANKLES = [Joint.ANKLE_LEFT, Joint.ANKLE_RIGHT]


def figures(family: str, count: int = 60) -> list[Figure]:
    """As many figures of a family, of any build."""
    made = []
    for seed in range(count):
        dice = np.random.default_rng([7, seed])
        made.append(random_figure(Performer(random_build(dice)), dice, dice.uniform(-3, 3), family))
    return made


def test_a_high_leg_is_high_while_the_other_stands():
    """The foot that stands is flat, or nearly: its ankle is a hand's width above the floor."""
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
def test_nobody_is_in_the_floor_or_above_it(family):
    for figure in figures(family, 12):
        assert -0.06 < figure.joints[:, 1].min() < 0.2
