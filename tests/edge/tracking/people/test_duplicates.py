"""Tests that a person who is tracked twice is noticed, and that people who pass each other are not."""

from types import SimpleNamespace

import numpy as np
import pytest

from enliven.person import Joint
from enliven_edge.tracking.people.track_manager import Duplicates

FRAMES = 60
"""Number of frames, two seconds, after which a duplicate must have been found."""


def track(found_ns: int, x: float, *, is_hidden: bool = False) -> SimpleNamespace:
    """Returns the part of a tracked person that matters here, at (x, 0, 2) metres."""
    joints = np.tile([x, 1.0, 2.0], (len(Joint), 1))
    follower = SimpleNamespace(posture=SimpleNamespace(joints=lambda: joints))
    return SimpleNamespace(
        found_ns=found_ns, is_hidden=is_hidden, place=np.array([x, 0.0, 2.0]), follower=follower
    )


def find_in_frames(
    duplicates: Duplicates, people: list[SimpleNamespace], frames: int
) -> list[SimpleNamespace]:
    """Returns the duplicates in the last of some equal frames."""
    return [duplicates.find(people) for _ in range(frames)][-1]


def test_the_later_of_two_tracks_at_one_place_is_a_duplicate() -> None:
    later, earlier = track(2, 0.02), track(1, 0.0)
    assert Duplicates().find([later, earlier]) == [], "one frame is not enough"
    assert find_in_frames(Duplicates(), [later, earlier], FRAMES) == [later]


@pytest.mark.parametrize("other", [track(2, 0.6), track(2, 0.02, is_hidden=True)])
def test_neighbours_and_hidden_people_are_no_duplicates(other: SimpleNamespace) -> None:
    assert find_in_frames(Duplicates(), [track(1, 0.0), other], FRAMES) == []


def test_people_who_pass_each_other_are_no_duplicates() -> None:
    duplicates, first, second = Duplicates(), track(1, 0.0), track(2, 0.0)
    for step in range(FRAMES):
        second.place[0] = 0.6 if step % 2 else 0.0  # At the same place in every other frame only.
        assert duplicates.find([first, second]) == []
