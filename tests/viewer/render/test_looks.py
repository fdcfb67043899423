"""Tests that the image agrees with the settings of the stage's looks."""

from __future__ import annotations

from dataclasses import replace
from typing import get_args

import numpy as np
import pytest

from enliven.errors import InputError
from enliven.settings import load_settings
from enliven_viewer.render.camera import CameraView, look_at, make_perspective
from enliven_viewer.render.renderer import Renderer
from enliven_viewer.render.scene import PLAIN, Scene, SceneCharacter
from enliven_viewer.render.stage_look import LOOKS
from enliven_viewer.settings import LookName, RenderSettings, ViewerSettings

SMALL = RenderSettings(shadow_size=64, contact_size=32, samples=1)


def shown(gl, of: RenderSettings, *boxes, eye=(0.0, 1.5, 5.0)) -> np.ndarray:
    renderer = Renderer(gl, (80, 60), of)
    camera = look_at(np.array(eye), np.array([0.0, 0.8, 0.0]))
    actors = tuple(SceneCharacter(character, character.rest_pose()) for character in boxes)
    extent = (np.array([-0.3, 0.0, -0.3]), np.array([0.3, 1.0, 0.3]))
    view = CameraView(np.array(eye), camera, make_perspective(0.9, 4 / 3, 0.1, 90.0))
    renderer.draw(Scene(actors, (), PLAIN, extent=extent), view)
    return renderer.pixels().astype(float)


def test_every_look_has_a_name_and_is_unlike_the_others(gl, box) -> None:
    assert set(LOOKS) == set(get_args(LookName))
    pictures = [shown(gl, replace(SMALL, look=look), box) for look in LOOKS]
    for k, image in enumerate(pictures):
        assert all(abs(image - other).mean() > 5 for other in pictures[:k])


def test_the_character_stands_out_from_every_look(gl, box) -> None:
    for look in LOOKS:
        with_box, without = (shown(gl, replace(SMALL, look=look), *some) for some in ((box,), ()))
        assert np.percentile(abs(with_box - without).max(2), 99.3) > 40


@pytest.mark.parametrize("colour", ["#22334a", "#c8d0e0", "#804020"])
def test_a_backdrop_is_shown_in_its_colour(gl, colour: str) -> None:
    wanted = [int(colour[k : k + 2], 16) for k in (1, 3, 5)]
    picture = shown(gl, replace(SMALL, backdrop=colour))
    np.testing.assert_allclose(picture[2:5, 30:50].mean((0, 1)), wanted, atol=12)  # slight vignetting


def test_a_backdrop_that_is_no_colour_is_refused_with_its_key() -> None:
    with pytest.raises(InputError, match="not a colour"):
        load_settings(ViewerSettings, {"render": {"backdrop": "blue"}})


def test_the_grid_is_drawn_where_it_is_wanted(gl) -> None:
    lines, bare = (shown(gl, replace(SMALL, grid=grid)) for grid in (True, False))
    # Grid lines are brighter, and everything else is equal.
    assert (lines - bare).max() > 4 and (lines - bare).min() >= -1
    assert abs(lines - bare)[:20].max() <= 1


def test_a_shadow_falls_away_from_the_light(gl, box) -> None:
    def darker(around: float) -> float:
        """Returns the brightness by which the box darkens the left of the floor more than the right."""
        own = replace(SMALL, light_around=around, light_up=25.0)
        less = shown(gl, own, eye=(0.0, 1.6, 4.0)) - shown(gl, own, box, eye=(0.0, 1.6, 4.0))
        return float(less[:, :34].mean() - less[:, 46:].mean())

    assert darker(75.0) > 0.2 and darker(-75.0) < -0.2  # on the side opposite to the light
