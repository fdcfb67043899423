"""Tests of training samples ("lessons"): the same seed gives the same lesson, and labels agree with the
image.
"""

from __future__ import annotations

from dataclasses import astuple

import numpy as np
import pytest

from enliven.errors import InputError
from enliven.person.joints import Joint
from enliven_edge.tracking.estimator.labels import MIRRORED, NOBODY, BodyPart
from enliven_synthesis.training import dataset, samples
from enliven_synthesis.training.dataset import Dataset, render_dataset
from enliven_synthesis.training.rendering import PersonRenderer
from enliven_synthesis.training.samples import LABEL_COLUMNS, LABEL_ROWS, TrainingSample, training_sample

OWN_PARTS = {
    Joint.HEAD: (BodyPart.HEAD,),
    Joint.ELBOW_LEFT: (BodyPart.UPPER_ARM_LEFT, BodyPart.FOREARM_LEFT),
    Joint.ELBOW_RIGHT: (BodyPart.UPPER_ARM_RIGHT, BodyPart.FOREARM_RIGHT),
    Joint.WRIST_LEFT: (BodyPart.FOREARM_LEFT, BodyPart.HAND_LEFT),
    Joint.WRIST_RIGHT: (BodyPart.FOREARM_RIGHT, BodyPart.HAND_RIGHT),
    Joint.KNEE_LEFT: (BodyPart.THIGH_LEFT, BodyPart.SHANK_LEFT),
    Joint.KNEE_RIGHT: (BodyPart.THIGH_RIGHT, BodyPart.SHANK_RIGHT),
}
"""Body parts visible at a joint, unless it is occluded."""


def same(one: tuple, other: tuple) -> bool:
    """Returns True if all arrays of two samples are equal. The facing of an object is NaN in both."""
    return all(np.array_equal(a, b, equal_nan=True) for a, b in zip(one, other, strict=True))


@pytest.fixture(scope="module")
def every_lesson() -> list[TrainingSample]:
    """Returns lessons with people and lessons with objects."""
    studio, dice = PersonRenderer(), np.random.default_rng(11)
    return [training_sample(studio, dice, 0.5) for _ in range(60)]


@pytest.fixture(scope="module")
def lessons(every_lesson) -> list[TrainingSample]:
    """Returns the lessons with people."""
    return [lesson for lesson in every_lesson if np.isfinite(lesson.facing)]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Returns the folder of an album of ten lessons, rendered by one process."""
    album = tmp_path_factory.mktemp("album")
    render(album, processes=1)
    return album


def render(folder, processes: int, count: int = 10) -> list[int]:
    """Renders a data set with ``processes`` processes and three samples per shard. Also returns the reported
    progress.
    """
    progress: list[int] = []
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(dataset, "SHARD_SAMPLES", 3)
        patch.setattr(dataset.os, "cpu_count", lambda: processes)
        render_dataset(folder, count, 0.5, 3, progress.append)
    return progress


def seen_at(joints: np.ndarray, cell: float, parts: np.ndarray) -> dict[Joint, int]:
    """Returns the body part visible at each joint of :data:`OWN_PARTS`, NOBODY if the image shows an
    object.
    """
    labels = {}
    for joint in OWN_PARTS:
        column, row = np.floor(joints[joint, :2] / (2 * cell) + [LABEL_COLUMNS / 2, LABEL_ROWS / 2])
        inside = 0 <= column < LABEL_COLUMNS and 0 <= row < LABEL_ROWS
        labels[joint] = int(parts[int(row), int(column)]) if inside else NOBODY
    return labels


def shares(cases) -> tuple[float, float]:
    """Returns the fractions of visible joints on their own part and on the opposite side's part.

    Args:
        cases: (joints, cell, parts) of some lessons.
    """
    own, other = [], []
    for case in cases:
        for joint, part in seen_at(*case).items():
            if part != NOBODY:
                own.append(part in OWN_PARTS[joint])
                other.append(part not in OWN_PARTS[joint] and MIRRORED[part] in OWN_PARTS[joint])
    return float(np.mean(own)), float(np.mean(other))


@pytest.mark.slow
def test_the_same_dice_make_the_same_lesson(every_lesson):
    """The result does not depend on the images that were rendered before."""
    studio = PersonRenderer()
    studio.render_person(np.random.default_rng(1))
    dice = np.random.default_rng(11)
    for lesson in every_lesson[:5]:
        assert same(astuple(lesson), astuple(training_sample(studio, dice, 0.5)))


def test_a_joint_lies_where_its_own_part_is_seen(lessons):
    own, other = shares((lesson.joints, lesson.cell, lesson.parts) for lesson in lessons)
    assert own > 0.7
    assert other < 0.06


def test_lessons_contain_a_person_and_valid_numbers(lessons):
    for lesson in lessons:
        person, depth, height, unknown = lesson.image
        assert np.isfinite(lesson.image).all() and np.isfinite(lesson.joints).all()
        assert ((person >= 0) & (unknown >= 0) & (person + unknown <= 1)).all()
        assert person.any() and not depth[person == 0].any() and not height[person == 0].any()
        assert set(np.unique(lesson.parts)) <= {*range(len(BodyPart)), NOBODY}
    assert np.median([np.abs(lesson.joints).max() for lesson in lessons]) < 1.5, "joints are about the person"


def test_parts_are_where_the_person_is(lessons):
    right = []
    for lesson in lessons:
        person = lesson.image[0].reshape(LABEL_ROWS, 2, LABEL_COLUMNS, 2).mean((1, 3))
        if (person == 1.0).any():
            right.append(np.mean((lesson.parts != NOBODY)[person == 1.0]))
        assert not (lesson.parts != NOBODY)[person == 0.0].mean() > 0.05
    assert np.mean(right) > 0.9
    assert len(right) > 0.8 * len(lessons), "few are seen so patchily that no cell is all theirs"


@pytest.mark.slow
def test_an_album_is_the_same_by_however_many_processes(folder, tmp_path):
    progress = render(tmp_path, processes=3)
    assert sorted(progress) == [1, 3, 3, 3], "ten lessons"
    first, other = (Dataset(each).batch(np.arange(10)) for each in (folder, tmp_path))
    assert same(astuple(first), astuple(other))
    assert len({image.tobytes() for image in first.image}) == 10, "no lesson comes twice"


def test_a_batch_is_in_rising_order(folder):
    every = Dataset(folder)
    assert len(every) == 10
    drawn, whole = every.batch(np.array([7, 2, 5, 2])), every.batch(np.arange(10))
    for some, all_of_them in zip(astuple(drawn), astuple(whole), strict=True):
        np.testing.assert_array_equal(some, all_of_them[[2, 2, 5, 7]])  # clutter has no facing: NaN


def test_inconsistent_album_arrays_are_refused(tmp_path):
    (tmp_path / dataset.COMPLETION_FILE).write_text("2 lessons")
    head = "{'descr': '<f4', 'fortran_order': False, 'shape': (1000000000,), }".ljust(117) + "\n"
    for name in dataset.ARRAYS:
        (tmp_path / f"{name}.npy").write_bytes(b"\x93NUMPY\x01\x00\x76\x00" + head.encode())
    with pytest.raises(InputError, match="an array of the data set is damaged"):
        Dataset(tmp_path)


def test_included_wall_is_next_to_the_person_and_keeps_their_depth():
    studio, dice = PersonRenderer(), np.random.default_rng(3)
    added = 0
    for _ in range(12):
        rendered = studio.render_person(dice, frontal=0.5)
        mask = rendered.z > 0
        if not mask.any():
            continue
        z, included = samples.add_wall(rendered.z, mask, dice)
        wall = included & ~mask
        assert (included | ~mask).all()
        np.testing.assert_array_equal(z[~wall], rendered.z[~wall])
        assert (z[wall] >= np.float32(0.3)).all()
        added += bool(wall.any())
    assert added > 6


def test_wall_left_next_to_a_person_is_labelled_nobody(monkeypatch):
    studio, dice = PersonRenderer(), np.random.default_rng(5)
    rendered = studio.render_person(dice, frontal=0.5)
    mask = rendered.z > 0
    for _ in range(20):
        z, leftover = samples.add_wall_alone(rendered.z, mask, dice)
        assert not (leftover & mask).any()
        np.testing.assert_array_equal(z[mask], rendered.z[mask])
    monkeypatch.setattr(samples, "CLUTTER_FRACTION", 1.0)
    monkeypatch.setattr(samples, "_WALL_REST_FRACTION", 1.0)
    for _ in range(5):
        lesson = training_sample(studio, dice, 0.5)
        assert np.isnan(lesson.facing) and (lesson.parts == NOBODY).all()
