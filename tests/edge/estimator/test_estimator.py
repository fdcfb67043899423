"""Tests of the shipped network: joint accuracy, confidence and facing, for one person or several."""

from __future__ import annotations

import re
from concurrent.futures import ThreadPoolExecutor
from functools import cache

import numpy as np
import pytest
from people_for_estimator import Fresh, fresh
from scipy.stats import spearmanr

from enliven.errors import InputError
from enliven.person.joints import MIRROR
from enliven_edge.assets import ESTIMATOR
from enliven_edge.tracking.estimator.crop import crop_person
from enliven_edge.tracking.estimator.estimator import Estimate, PoseEstimator, load_shipped_estimator
from enliven_edge.tracking.estimator.labels import FACINGS, MIRRORED
from enliven_synthesis.training.rendering import PersonRenderer

PICTURES = 60
# Each bound below is slightly looser than the shipped network's value on these images.
WITHIN_TOLD, WITHIN_NOT_TOLD = 0.72, 0.715
"""Minimum fraction of joints within 10 cm, occluded ones included, with and without the facing as input."""
FACING_RIGHT, FACING_NEARLY_RIGHT = 0.8, 0.94
"""Minimum fraction of people with the correct facing, and with a facing within an eighth of a turn."""
PARTS_RIGHT = 0.82
"""Minimum fraction of the person's pixels with the correct body part."""
BELIEVED, PEOPLE_BELIEVED, THINGS_BELIEVED = 0.8, 0.97, 0.1
"""Minimum person probability of an accepted blob. Minimum fraction of people above it, of whom many are
mostly occluded. Maximum fraction of objects above it.
"""
RANKED = 0.83
"""Minimum rank correlation of the estimated and the true joint errors."""
SAID = (0.9, 1.35)
"""Bounds of the ratio of true to estimated joint error, for all joints on average and for confident
joints.
"""
SURE, UNSURE = 0.06, 0.3
"""Metres: joints with a smaller estimated error count as visible, joints with a larger one as guessed."""
MIRRORED_WITHIN = 0.035
"""Maximum median difference, metres, between a person's joints and those of their mirror image."""


@cache
def judged(told: bool) -> tuple[np.ndarray, np.ndarray]:
    """Returns (60, 20) true and estimated errors of every joint, metres."""
    seen = [(fresh(n), fresh(n).estimate(told)) for n in range(PICTURES)]
    off = [np.linalg.norm(e.joints - f.picture.figure.joints, axis=1) for f, e in seen]
    return np.stack(off), np.stack([e.expected_errors for _, e in seen])


@pytest.mark.slow
@pytest.mark.parametrize(("told", "least"), [(True, WITHIN_TOLD), (False, WITHIN_NOT_TOLD)])
def test_joints_are_found_in_fresh_pictures(told, least):
    off, _ = judged(told)
    assert np.mean(off < 0.1) > least


def test_estimated_joint_error_matches_the_true_error():
    off, estimated = judged(False)
    assert spearmanr(off.ravel(), estimated.ravel()).statistic > RANKED
    for some in (estimated < SURE, (estimated >= SURE) & (estimated < UNSURE)):
        assert some.mean() > 0.27
        assert SAID[0] < off[some].mean() / estimated[some].mean() < SAID[1]


def test_facing_is_estimated_correctly():
    wrong = []
    for n in range(PICTURES):
        facing = int(fresh(n).estimate(False).facing.argmax())
        wrong.append((facing - round(fresh(n).facing * FACINGS / (2 * np.pi))) % FACINGS)
    assert np.mean(np.array(wrong) == 0) > FACING_RIGHT
    assert np.mean(np.isin(wrong, (0, 1, FACINGS - 1))) > FACING_NEARLY_RIGHT


@pytest.mark.slow
def test_people_are_distinguished_from_objects():
    """Measured on new images of people and objects, at the probability above which the tracker accepts a
    person.
    """
    studio = PersonRenderer()
    people = [fresh(n).estimate(False).person_probability for n in range(PICTURES)]
    things = []
    for n in range(PICTURES):
        p = studio.render_clutter(np.random.default_rng([77, n]))
        z = np.where(p.z > 0, p.z, p.around).astype(np.float64)
        things.append(
            load_shipped_estimator()
            .estimate(z, p.z > 0, p.camera, p.world_from_camera, None)
            .person_probability
        )
    assert np.mean(np.array(people) > BELIEVED) > PEOPLE_BELIEVED
    assert np.mean(np.array(things) > BELIEVED) < THINGS_BELIEVED


def test_facings_are_probabilities_independent_of_the_input():
    for n in range(10):
        estimate = fresh(n).estimate(False)
        assert np.exp(estimate.facing).sum() == pytest.approx(1.0)
        np.testing.assert_allclose(fresh(n).estimate(True).facing, estimate.facing, atol=1e-4)


def test_body_parts_are_estimated_correctly():
    right = []
    for n in range(PICTURES):
        case = fresh(n)
        v, u = np.nonzero(case.mask)
        rays = (np.stack([u, v], 1) - case.picture.camera[2:]) / case.picture.camera[:2]
        right.append(case.estimate(True).parts_at(rays).argmax(0) == case.picture.label[v, u])
    assert np.mean(np.concatenate(right)) > PARTS_RIGHT


def mirror_image(case: Fresh) -> Estimate:
    """Mirrors the view of a person, and the world around them."""
    camera, mirror = case.picture.camera.copy(), np.diag([-1.0, 1.0, 1.0, 1.0])
    camera[2] = case.z.shape[1] - 1 - camera[2]
    pose = mirror @ case.picture.world_from_camera @ mirror
    z, mask = case.z[:, ::-1].copy(), case.mask[:, ::-1].copy()
    return load_shipped_estimator().estimate(z, mask, camera, pose, -case.facing)


def test_the_mirror_image_is_of_the_mirrored_person():
    apart, alike = [], []
    for n in range(PICTURES):
        upright, mirrored = fresh(n).estimate(True), mirror_image(fresh(n))
        back = mirrored.joints[list(MIRROR)] * [-1.0, 1.0, 1.0]
        apart.append(np.linalg.norm(back - upright.joints, axis=1))
        parts = mirrored.parts[MIRRORED][..., ::-1].argmax(0) == upright.parts.argmax(0)
        person = upright.crop.image[0].reshape(40, 2, 32, 2).mean((1, 3)) > 0.9
        alike.append(parts[person])
    assert np.median(apart) < MIRRORED_WITHIN
    assert np.mean(np.concatenate(alike)) > PARTS_RIGHT


def test_world_frame_changes_only_joint_positions():
    """The world frame is rotated about the vertical and moved along the floor."""
    for n in range(5):
        case = fresh(n)
        moved = np.eye(4)
        moved[[0, 0, 2, 2], [0, 2, 0, 2]] = np.cos(n), np.sin(n), -np.sin(n), np.cos(n)
        moved[[0, 2], 3] = 3.0, -n
        there = case.estimate(True)
        here = load_shipped_estimator().estimate(
            case.z, case.mask, case.picture.camera, moved @ case.picture.world_from_camera, case.facing
        )
        np.testing.assert_allclose(here.joints, there.joints @ moved[:3, :3].T + moved[:3, 3], atol=1e-3)
        np.testing.assert_allclose(here.expected_errors, there.expected_errors, atol=1e-3)


def test_batched_facings_equal_single_ones():
    facings = [None, 0.0, 1.0, -2.0, np.pi]
    for n in range(5):
        case = fresh(n)
        pose = case.picture.world_from_camera
        crop = crop_person(case.z, case.mask, case.picture.camera, pose)
        at_once = load_shipped_estimator().estimates(crop, pose, facings)
        for facing, estimate in zip(facings, at_once, strict=True):
            alone = load_shipped_estimator().estimate(case.z, case.mask, case.picture.camera, pose, facing)
            for name in ("joints", "expected_errors", "facing", "parts"):
                np.testing.assert_allclose(getattr(estimate, name), getattr(alone, name), atol=2e-3)


def test_several_threads_give_the_same_estimates():
    expected = [fresh(n).estimate(True) for n in range(12)]
    with ThreadPoolExecutor(4) as pool:
        several = list(pool.map(lambda n: fresh(n % 12).estimate(True), range(36)))
    for n, estimate in enumerate(several):
        # Like above, a network that runs in other threads may sum in a different order.
        np.testing.assert_allclose(estimate.joints, expected[n % 12].joints, atol=1e-4)
        np.testing.assert_allclose(estimate.parts, expected[n % 12].parts, atol=1e-4)


def test_the_file_is_small():
    assert ESTIMATOR.stat().st_size < 10e6


def test_missing_network_file_is_reported_with_advice(tmp_path):
    with pytest.raises(
        InputError, match=r"none\.onnx: the neural network cannot be read.*tracker\.estimator"
    ):
        PoseEstimator(tmp_path / "none.onnx")


@pytest.mark.parametrize("keep", [0, 10, 4000, -30])
def test_damaged_network_file_is_refused_with_advice(tmp_path, keep):
    (tmp_path / "cut.onnx").write_bytes(ESTIMATOR.read_bytes()[:keep])
    with pytest.raises(
        InputError, match=r"cut\.onnx: the neural network cannot be read.*Install enliven again"
    ):
        PoseEstimator(tmp_path / "cut.onnx")


def test_a_file_of_something_else_is_refused(tmp_path):
    (tmp_path / "other.onnx").write_bytes(b"\x89PNG\r\n" + bytes(range(256)) * 40)
    with pytest.raises(InputError, match="cannot be read"):
        PoseEstimator(tmp_path / "other.onnx")


def test_shipped_network_contains_no_source_paths():
    held = ESTIMATOR.read_bytes()
    assert re.search(rb"\.py\b", held) is None and b"enliven_edge" not in held
