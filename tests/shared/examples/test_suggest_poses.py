"""Tests of suggesting which poses to model next, and of mirroring poses to the other side."""

import numpy as np
import pytest
from tolerances import assert_alike

from enliven.errors import InputError
from enliven.examples.poses import Examples
from enliven.examples.suggest import SuggestSettings, distance_to, suggest_further_poses, suggest_poses
from enliven.examples.symmetric import add_mirror_images, find_partners, mirror_places, reflect_points

NAMES = ("left", "right", "middle")
ORDER = (1, 0, 2)


def test_the_suggested_are_the_farthest():
    rng = np.random.default_rng(1)
    poses = rng.normal(size=(200, 4, 3))
    suggested = suggest_poses(poses, SuggestSettings(most=8))
    away = np.sqrt(((poses[:, None] - poses[list(suggested.frames)]) ** 2).sum(3).mean(2))
    for k in range(1, 8):
        assert away[:, :k].min(1).argmax() == suggested.frames[k]
    np.testing.assert_allclose(suggested.gaps, [away[:, : k + 1].min(1).max() for k in range(8)])
    assert list(suggested.gaps) == sorted(suggested.gaps, reverse=True)


def test_as_many_are_suggested_as_there_are_poses():
    poses = np.random.default_rng(2).normal(size=(4, 5, 3))[np.arange(300) // 80]
    suggested = suggest_poses(poses, SuggestSettings(enough=0.1))
    assert suggested.count == len(suggested.frames) == 4
    assert len({f // 80 for f in suggested.frames}) == 4


def test_motionless_take_is_refused():
    with pytest.raises(InputError, match="does not move"):
        suggest_poses(np.ones((50, 3, 3)))


def one_sided():
    rng = np.random.default_rng(3)
    sources = rng.normal(size=(3, 3, 3)) * 0.2 + [[1, 0, 0], [-1, 0, 0], [0, 1, 0]]
    targets = rng.normal(size=(3, 3, 3)) * 0.2 + [[2, 0, 1], [0, 0, 1], [1, 1, 1]]
    sources[0] = 0.5 * (
        sources[0] + reflect_points(sources[0][list(ORDER)], np.zeros(3), np.array([1.0, 0, 0]))
    )
    return Examples(NAMES, NAMES, sources, targets)


def test_doubled_examples_are_their_own_mirror_image():
    examples, plane = one_sided(), (np.array([1.0, 0, 0]), np.array([2.0, 0, 0]))
    rest = np.array([[2.0, 0, 1], [0, 0, 1], [1, 1, 1]])
    more = add_mirror_images(examples, ORDER, rest, plane[1], across=np.array([1.0, 0, 0]))
    # The first example is its own mirror image.
    assert len(more) == 5
    mirrored = reflect_points(more.sources[:, ORDER], np.zeros(3), np.array([1.0, 0, 0]))
    for source, target in zip(mirrored, reflect_points(more.targets[:, ORDER], *plane), strict=True):
        away = np.abs(more.sources - source).max((1, 2))
        assert away.min() < 1e-9
        if away.argmin() > 0:
            np.testing.assert_allclose(more.targets[away.argmin()], target, atol=1e-9)
    again = add_mirror_images(more, ORDER, rest, plane[1], across=np.array([1.0, 0, 0]))
    assert len(again) == 5


def test_partners_are_found_on_the_mesh():
    rest = np.array([[2, 0, 1], [0.02, 0, 1], [1, 1, 1.0]])
    assert find_partners(rest, np.array([1.0, 0, 0]), np.array([1.0, 0, 0])) == ORDER
    with pytest.raises(InputError, match="control point 0 has no mirror image"):
        find_partners(
            rest + np.array([[0.9, 0, 0], [0, 0, 0], [0, 0, 0]]), np.array([1.0, 0, 0]), np.array([1.0, 0, 0])
        )
    with pytest.raises(InputError, match="are not mutual"):
        add_mirror_images(one_sided(), (1, 2, 0), rest, np.array([1.0, 0, 0]))


def test_resting_points_stay_at_rest_when_mirrored_on_nearly_symmetric_mesh():
    rng = np.random.default_rng(0)
    rest = np.array([[2, 0, 1], [0.02, 0, 1], [1.05, 1, 1.0]])
    normal = np.array([1.0, 0, 0])
    assert_alike(mirror_places(rest, rest, ORDER, normal), rest)
    places = rest + rng.normal(size=(4, 3, 3))
    once = mirror_places(places, rest, ORDER, normal)
    np.testing.assert_allclose(once[:, 0] - rest[0], (places[:, 1] - rest[1]) * [-1, 1, 1], atol=1e-12)
    np.testing.assert_allclose(mirror_places(once, rest, ORDER, normal), places, atol=1e-12)


def test_next_suggestion_is_farthest_from_existing_poses():
    rng = np.random.default_rng(5)
    poses = rng.normal(size=(200, 4, 3))
    existing = poses[[3, 70]] + 0.01 * rng.normal(size=(2, 4, 3))
    suggested = suggest_further_poses(poses, existing, SuggestSettings(most=8))
    away = np.sqrt(
        ((poses[:, None] - np.concatenate([existing, poses[list(suggested.frames)]])) ** 2).sum(3).mean(2)
    )
    assert len(suggested.frames) == 6
    for k, frame in enumerate(suggested.frames):
        nearest = away[:, : 2 + k].min(1)
        assert nearest.argmax() == frame and suggested.gaps[k] == pytest.approx(nearest.max())
    np.testing.assert_allclose(distance_to(poses, existing), away[:, :2].min(1))


def test_complete_examples_need_no_suggestions():
    poses = np.random.default_rng(6).normal(size=(3, 5, 3))[np.arange(120) // 40]
    suggested = suggest_further_poses(poses, poses[[0, 40, 80]])
    assert suggested.count == 0 and suggested.frames == ()
    assert suggest_further_poses(poses, poses[[0]], SuggestSettings(enough=0.1)).count == 2
