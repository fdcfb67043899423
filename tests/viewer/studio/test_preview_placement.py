"""Tests of the camera preview: performers as seen by their camera, in the corner that hides least."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from made_performer import performer

from enliven.person import Body, Joint
from enliven_viewer.studio.app.panel_layout import Area
from enliven_viewer.studio.features.perform.live_texts import find_area_next_to_preview
from enliven_viewer.studio.features.perform.preview_placement import (
    DEFAULT_ASPECT,
    PreviewPlacement,
    find_rectangle,
    project_bodies,
)
from enliven_viewer.studio.preferences import Preferences

SIZES = [(900.0, 501.0), (992.0, 501.0), (3460.0, 1940.0), (400.0, 160.0)]


def moved(body: Body, right: float, away: float) -> Body:
    return Body(body.id, body.joints + np.array([right, 0.0, -away]), body.confidence)


@settings(deadline=None, max_examples=25)
@given(st.floats(0.0, 17.0), st.floats(-0.4, 0.4), st.floats(0.3, 3.0))
def test_a_performer_stands_upright_in_the_view_and_smaller_from_farther(second, right, away):
    near, far = (project_bodies([moved(performer(second), right, more)])[0] for more in (0.0, away))
    for skeleton in (near, far):
        assert np.isfinite(skeleton.places).all()
        assert (
            skeleton.places[Joint.HEAD, 1]
            < skeleton.places[Joint.HIP_CENTER, 1]
            < skeleton.places[Joint.ANKLE_LEFT, 1]
        )
    assert np.ptp(far.places[:, 1]) < np.ptp(near.places[:, 1])
    assert far.pixels(0.1, int(Joint.HEAD)) < near.pixels(0.1, int(Joint.HEAD))
    depths = [near.depth[list(bone)].sum() for bone in near.bones]
    assert depths == sorted(depths, reverse=True), "nearer limbs are drawn over farther ones"


def test_performer_behind_the_world_camera_is_seen_from_the_front():
    (skeleton,) = project_bodies([moved(performer(1.0), 3.0, -4.0)])
    inside = (skeleton.places > 0.0) & (skeleton.places < [DEFAULT_ASPECT, 1.0])
    assert inside.all() and project_bodies([]) == ()


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("views", [1, 2, 3])
def test_inset_is_inside_the_picture(size, views):
    left, top, wide, tall = PreviewPlacement().place(*size, views, list)
    assert left >= 0 and top >= 0 and left + wide <= size[0] and top + tall <= size[1]
    assert wide == pytest.approx(views * DEFAULT_ASPECT * tall) and wide <= 0.5 * size[0]


def test_inset_leaves_a_covered_corner_and_stays_in_the_next():
    inset, size = PreviewPlacement(), (900.0, 501.0)
    low = inset.place(*size, 1, list)
    top = [inset.place(*size, 1, lambda: [low]) for _ in range(60)][-1]
    assert top[1] < low[1] and top[0] == low[0]
    assert [inset.place(*size, 1, list) for _ in range(60)][-1] == top, "nothing covers it: it stays"


@pytest.mark.parametrize("corner", ["low right", "low left", "top right", "wide"])
def test_attachment_texts_avoid_the_inset(corner):
    area = Area(10.0, 20.0, 600.0, 300.0)
    wide = 500.0 if corner == "wide" else 150.0
    left = 10.0 if "left" in corner else 610.0 - wide
    top = 20.0 if "top" in corner else 220.0
    free = find_area_next_to_preview(area, (left, top, left + wide, top + 100.0))
    apart = free.x + free.width <= left or free.x >= left + wide
    assert apart == ("low" in corner) and (apart or free == area)
    assert find_area_next_to_preview(area, None) == area


def test_points_behind_the_camera_cover_nothing():
    assert find_rectangle(np.array([[1.0, 2.0], [np.nan, 3.0]])) is None
    assert find_rectangle(np.array([[1.0, 2.0], [4.0, 6.0]])) == (1.0, 2.0, 3.0, 4.0)


def test_inset_visibility_is_remembered(tmp_path):
    chosen = Preferences(tmp_path)
    assert chosen.performer
    chosen.watch_performer()
    assert not Preferences(tmp_path).performer
