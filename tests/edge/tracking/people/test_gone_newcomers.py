"""Tests that a search for a person ends when its initial pixels have disappeared."""

from __future__ import annotations

import numpy as np
import pytest

from enliven.camera import Intrinsics, world_from_level_camera
from enliven_edge.tracking.fit.fit import Fitter
from enliven_edge.tracking.frame.observation import FrameView, WorkingCamera, world_points
from enliven_edge.tracking.people.people import MultiPersonTracker
from enliven_edge.tracking.scene.background_kernels import UNSEEN
from enliven_edge.tracking.scene.background_model import BackgroundModel
from enliven_edge.tracking.segment.segmentation import segment_people
from enliven_edge.tracking.settings import TrackerSettings
from enliven_edge.tracking.work_budget import Budget

CAMERA = WorkingCamera(Intrinsics(80, 60, 66, 66, 39.5, 29.5), 80)
MOUNT = world_from_level_camera(1.2)
STEP_NS = 33_333_333


def view_of(frame: int, shown: bool) -> FrameView:
    """Returns a view of a flat shape of a person's size at 2.4 m, or of nothing."""
    x, y = CAMERA.ray[..., 0] * 2.4, 1.2 - CAMERA.ray[..., 1] * 2.4
    z = np.where(shown & (np.abs(x) < 0.25) & (y > 0.1) & (y < 1.7), 2.4, 0.0)
    return FrameView(frame * STEP_NS, z, world_points(z, CAMERA.ray, MOUNT), CAMERA, MOUNT)


@pytest.mark.parametrize(("gone_for", "is_lost"), [(0, False), (1, False), (6, False), (8, True)])
def test_search_has_lost_all_a_moment_after_its_pixels_are_gone(gone_for, is_lost):
    """Furniture that became background is no longer searched. Some noisy frames change nothing."""
    settings = TrackerSettings(estimator=False)
    finder = MultiPersonTracker(settings, Fitter(settings.fit)).finder
    for frame in range(2 + gone_for):
        view = view_of(frame, shown=frame < 2)
        kind = np.where(view.z > 0, UNSEEN, 0).astype(np.uint8)
        segments = segment_people(view, kind, [])
        newcomers = finder._candidates.update(
            view, kind, segments, lambda _: True, lambda _: False, young=True
        )
        if frame == 0:
            assert newcomers and not finder._has_lost_all(view)
            finder._search.start(view, newcomers, [], alone=True, max_bodies=1)
    assert finder._has_lost_all(view) == is_lost
    finder.set_budget(Budget(0.0))
    finder.find(view, kind, segments, BackgroundModel((60, 80)))
    assert not (is_lost and finder._search.searched_candidates)
