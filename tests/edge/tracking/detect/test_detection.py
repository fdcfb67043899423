"""Tests of detecting a person in a single frame, in postures of every class and of untrained builds.

Figures are fixed by their seeds. Tuning of the detection and training of the network used other seeds.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from people_seen_for_tests import CLASSES, SEEDS, seen_in, seen_person

from enliven.camera import Intrinsics
from enliven_edge.tracking.body_model import model
from enliven_edge.tracking.body_model.posture import Posture
from enliven_edge.tracking.detect.detection import detect
from enliven_edge.tracking.detect.fit_quality import fit_quality
from enliven_edge.tracking.detect.hypotheses import pose_from_estimate
from enliven_edge.tracking.estimator.labels import FACINGS
from enliven_edge.tracking.fit.fit import Fitter
from enliven_edge.tracking.frame.observation import Observation, WorkingCamera, observe_person, world_points
from enliven_edge.tracking.settings import FitSettings
from enliven_edge.tracking.work_budget import run_to_end

MEDIAN, FAR, NOT_FAR = 0.08, 0.15, 0.6
"""Maximum median error of visible joints in any class, metres. A larger error, and the minimum fraction of
joints below it.
"""
MORE_WITH, ALONE = 0.1, 0.5
"""Minimum improvement of the fraction of joints within 10 cm by the network, and minimum fraction without the
network.
"""
SUPPOSED = 0.10
"""Maximum median over people of the mean joint error of the best network estimate by facing, metres."""


@cache
def found(name: str, seed: int, network: bool) -> Posture:
    """Returns a person detected without history."""
    observation, _ = seen_person(name, seed)
    seen, by_facing = seen_in(observation) if network else (None, None)
    eye = observation.view[4][:3, 3]
    posture, report = run_to_end(detect(Fitter(FitSettings()), observation, eye, 1.72, seen, by_facing))
    assert fit_quality(report) > (0.6 if network else 0.5), f"{name} {seed}"
    return posture


def errors(name: str, *, network: bool) -> np.ndarray:
    """Returns the errors of all visible joints, metres, over all seeds."""
    distances = []
    for seed in SEEDS:
        observation, figure = seen_person(name, seed)
        in_sight = [np.linalg.norm(observation.points - j, axis=1).min() < 0.15 for j in figure.joints]
        off = np.linalg.norm(found(name, seed, network).joints() - figure.joints, axis=1)
        distances.append(off[in_sight])
    return np.concatenate(distances)


@pytest.mark.parametrize("name", CLASSES)
def test_people_are_found_in_any_posture(name):
    off = errors(name, network=True)
    assert np.median(off) < MEDIAN
    assert np.mean(off < FAR) > NOT_FAR


def test_the_network_finds_more_than_the_bank_alone():
    share = {
        network: np.mean(np.concatenate([errors(name, network=network) for name in CLASSES]) < 0.1)
        for network in (False, True)
    }
    assert share[True] > share[False] + MORE_WITH
    assert share[False] > ALONE


def test_best_network_posture_is_near_the_truth_for_most():
    best, lengths = [], model.lengths_for_height(1.72)
    for name in CLASSES:
        for seed in SEEDS:
            observation, figure = seen_person(name, seed)
            candidates = [
                pose_from_estimate(estimate, lengths).joints() for estimate in seen_in(observation)[1]
            ]
            best.append(min(np.linalg.norm(joints - figure.joints, axis=1).mean() for joints in candidates))
    assert np.median(best) < SUPPOSED


def test_network_postures_cover_the_likeliest_facing_and_the_opposite():
    observation, _ = seen_person("side", SEEDS[0])
    sighting, by_facing = seen_in(observation)
    likeliest = np.argmax(sighting.estimate.facing)
    assert len(by_facing) == 3
    assert all(each.crop is sighting.estimate.crop for each in by_facing)
    np.testing.assert_allclose(by_facing[0].joints, sighting.estimate.joints, atol=1e-3)
    ways = [2 * np.pi / FACINGS * way for way in (likeliest, likeliest + FACINGS / 2)]
    for way, each in zip(ways, by_facing[1:], strict=True):
        estimate = seen_in(observation, facing=way)[0].estimate
        np.testing.assert_allclose(each.joints, estimate.joints, atol=1e-3)


def hung_upside_down(observation: Observation) -> Observation:
    """Returns the same person, seen by a sensor that is mounted upside down."""
    z, mask, _, camera, pose = observation.view
    height, width = z.shape
    turned = pose.copy()
    turned[:3, :2] *= -1.0
    flipped = Intrinsics(width, height, *camera[:2], width - 1 - camera[2], height - 1 - camera[3])
    hung = WorkingCamera(flipped, width)
    z, mask = z[::-1, ::-1].copy(), mask[::-1, ::-1].copy()
    return observe_person(z, world_points(z, hung.ray, turned), mask, hung, turned, 900)


def test_upside_down_image_is_detected_alike():
    observation, figure = seen_person("one leg up", 901)
    fitter, eye = Fitter(FitSettings()), observation.view[4][:3, 3]
    for each in (observation, hung_upside_down(observation)):
        posture, _ = run_to_end(detect(fitter, each, eye, 1.72, *seen_in(each)))
        off = np.linalg.norm(posture.joints() - figure.joints, axis=1)
        assert np.median(off) < 0.12
