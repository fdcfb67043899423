"""Tests that doubtful people are searched again repeatedly, less often while nothing better is found."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from postures_seen_for_tests import CAMERA, MOUNT, picture

from enliven.camera import Intrinsics
from enliven_edge.tracking.body_model import joint_limits
from enliven_edge.tracking.body_model.model import lengths_for_height
from enliven_edge.tracking.body_model.posture import Posture
from enliven_edge.tracking.fit.fit import Fitter
from enliven_edge.tracking.frame.observation import FrameView, WorkingCamera, world_points
from enliven_edge.tracking.people import redetection
from enliven_edge.tracking.people.follower import Follower
from enliven_edge.tracking.settings import FitSettings, TrackerSettings

FEW = TrackerSettings(estimator=False, fit=FitSettings(points=60))
KNOWN = 16
"""Number of a frame in which the person is tracked and no new search is due."""
FIRST = 29
"""Number of the thirtieth frame, the first in which a new search is due."""


@pytest.fixture(scope="module")
def scene():
    """Returns (view, pixels, posture) of a person that stands still."""
    posture = Posture(np.array([0.0, 0.95, -2.5]), joint_limits.standing_pose(), lengths_for_height(1.7))
    z, mask = picture(posture)
    camera = WorkingCamera(Intrinsics(160, 120, *CAMERA), 160)
    return FrameView(0, z, world_points(z, camera.ray, MOUNT), camera, MOUNT), mask, posture


@pytest.fixture
def looks(scene, monkeypatch):
    """Returns a function from (frames, doubtful, finds) to the frames with a new search.

    ``doubtful(frame)`` is True if the fit is bad, ``finds(frame)`` if a search would find a better one.
    """

    def watched(frames: int, doubtful, finds=lambda frame: False) -> list[int]:
        view, mask, posture = scene
        someone, searches = Follower(FEW, Fitter(FEW.fit), posture.copy()), []

        def detect_another(fitter, observation, *_):
            searches.append(frame)
            if not finds(frame):
                return None
            yield 1
            fitted, report = fitter.fit(observation, posture)
            return fitted, replace(report, energy=-1e6)

        monkeypatch.setattr(redetection, "detect_another", detect_another)
        for frame in range(frames):
            monkeypatch.setattr(redetection, "_DOUBTFUL_COST", -np.inf if doubtful(frame) else np.inf)
            moment = replace(view, time_ns=frame * 33_333_333)
            assert someone.follow(moment, mask)
        return searches

    return watched


def test_well_explained_person_is_never_searched_again(looks):
    assert looks(80, lambda frame: False) == []


def test_unsuccessful_searches_become_rarer(looks):
    searches = looks(360, lambda frame: frame >= KNOWN)
    assert searches[0] == FIRST
    assert np.diff(searches).tolist() == [60, 120, 120]


def test_good_frame_resets_the_search_interval(looks):
    assert looks(175, lambda frame: frame >= KNOWN and frame != 60) == [29, 61, 121]


def test_successful_search_resets_the_search_interval(looks):
    assert looks(150, lambda frame: frame >= KNOWN, finds=lambda frame: frame == FIRST) == [29, 59, 119]


def test_doubtful_new_person_is_searched_again_after_a_second(looks):
    assert looks(80, lambda frame: True) == [FIRST]
