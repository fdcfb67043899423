"""Tests of the HUD: its contents and position, and that its text is drawn in its typeface."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from imgui_bundle import hello_imgui
from PIL import Image, ImageDraw, ImageFont

from enliven.health import HealthState, Severity
from enliven_viewer.live.hud import Hud, HudState, format_time, timeline_area, timeline_fraction
from enliven_viewer.playback.document import EdgeState
from enliven_viewer.render.overlay.canvas import Canvas
from enliven_viewer.theme import FONT

CHARACTERS = "".join(chr(code) for code in range(33, 127)) + "°·±é…"
"""Characters in the window's texts and in notices from edges."""


def canvas_of(gl, width: int, height: int):
    texture = gl.texture((width, height), 4)
    target = gl.framebuffer([texture])
    target.clear(0, 0, 0, 1)
    return target


def draw(gl, target, state: HudState, scale: float = 1.0) -> None:
    canvas = Canvas(gl)
    with canvas.draw_over(target):
        Hud(canvas, scale).draw((target.width, target.height), state)
    canvas.release()


def pixels(target) -> np.ndarray:
    raw = np.frombuffer(target.read(components=3, alignment=1), np.uint8)
    return raw.reshape(target.height, target.width, 3)[::-1].astype(int)


def test_a_rectangle_covers_its_pixels_and_no_others(gl) -> None:
    target, canvas = canvas_of(gl, 64, 48), Canvas(gl)
    with canvas.draw_over(target):
        canvas.rectangle(10, 5, 20, 8, (1, 1, 1, 1))
    expected = np.zeros((48, 64))
    expected[5:13, 10:30] = 255
    assert np.abs(pixels(target)[..., 0] - expected).max() <= 1


def written(gl, text: str, size: int, **where) -> tuple[np.ndarray, tuple[float, float]]:
    """Returns the (200, 400) coverage, 0..1, of a text at (100, 20), and the text's extent."""
    target, canvas = canvas_of(gl, 400, 200), Canvas(gl)
    with canvas.draw_over(target):
        canvas.text(100, 20, text, size, (1, 1, 1, 1), **where)
        extent = canvas.extent(text, size, where.get("wrap", 0.0))
    canvas.release()
    return pixels(target)[..., 0] / 255, extent


def test_text_is_what_the_typeface_draws(gl) -> None:
    font = ImageFont.truetype(hello_imgui.asset_file_full_path(FONT), 20)
    drawn, (width, height) = written(gl, "Hold: 3.5 ms", round(20 * sum(font.getmetrics()) / 20))
    plain = Image.new("L", (400, 200))
    ImageDraw.Draw(plain).text((100, 20), "Hold: 3.5 ms", fill=255, font=font)
    expected = np.asarray(plain) / 255
    assert abs(drawn.sum() / expected.sum() - 1) < 0.12
    for axis in (0, 1):
        ink, other = (np.nonzero(image.max(axis) > 0.3)[0] for image in (drawn, expected))
        assert abs(ink.min() - other.min()) <= 2 and abs(ink.max() - other.max()) <= 4
    assert width == pytest.approx(font.getlength("Hold: 3.5 ms"), abs=4)
    assert np.nonzero(drawn.max(1))[0].max() < 20 + height


def test_every_character_that_is_written_has_ink_of_its_own(gl) -> None:
    shapes = {written(gl, character, 24)[0].tobytes() for character in CHARACTERS}
    assert len(shapes) == len(CHARACTERS)


def test_text_is_aligned_right_or_centred(gl) -> None:
    for align in (0.5, 1.0):
        drawn, (width, _) = written(gl, "Hhhh", 20, align=align)
        ink = np.nonzero(drawn.max(0) > 0.3)[0]
        assert ink.min() == pytest.approx(100 - align * width, abs=3)
        assert ink.max() == pytest.approx(100 + (1 - align) * width, abs=3)


@given(st.text(alphabet="ab cd ef", max_size=60).filter(str.strip), st.integers(40, 200))
@settings(max_examples=20)
def test_no_line_is_wider_than_told_and_nothing_is_lost(gl, text: str, width: int) -> None:
    lines, (wide, _) = written(gl, " ".join(text.split()), 16, wrap=width)
    longest = max(written(gl, word, 16)[1][0] for word in text.split())
    assert wide <= max(width, longest) + 1
    assert np.nonzero(lines.max(0))[0].max(initial=0) <= 100 + max(width, longest) + 1
    apart = sum(written(gl, word, 16)[0].sum() for word in text.split())
    assert lines.sum() == pytest.approx(apart, rel=0.1)


@pytest.mark.parametrize("scale", [1.0, 2.0])
@pytest.mark.parametrize("size", [(1280, 720), (320, 200)])
def test_timeline_hit_area_equals_its_drawing(gl, scale, size) -> None:
    target = canvas_of(gl, *size)
    draw(gl, target, HudState(fraction=0.5, length_s=10), scale)
    x, y, width, height = timeline_area(size, scale)
    middle = pixels(target)[int(y + height / 2), int(min(x + width / 4, size[0] - 1))]
    assert middle[0] > 180 or width < 2
    assert timeline_fraction(x + width / 2, y, size, scale) == pytest.approx(0.5)
    assert timeline_fraction(x - 4, y, size, scale) == 0
    assert timeline_fraction(x, 0, size, scale) is None


@pytest.mark.parametrize(
    ("edge", "good"),
    [
        (EdgeState(True, phase="tracking"), True),
        (EdgeState(True, phase="tracking", signal="slow"), False),
        (EdgeState(True, phase="tracking", signal="silent"), False),
        (EdgeState(True, phase="ended"), False),
        (EdgeState(False, signal="silent"), False),
    ],
)
def test_only_frames_that_come_as_they_should_have_a_green_dot(gl, edge, good) -> None:
    target = canvas_of(gl, 1280, 720)
    draw(gl, target, HudState(edge=edge, length_s=10))
    x, y, width, height = timeline_area((1280, 720), 1.0)
    red, green, blue = pixels(target)[int(y + height / 2), int(x + width + 22)][:3].astype(int)
    assert (green > red + 40 and green > blue) == good


def test_all_elements_at_once_are_drawn_without_an_error(gl) -> None:
    target = canvas_of(gl, 640, 360)
    edge = EdgeState(True, "tcp://127.0.0.1:5580", "possessed", "a note", 21.0, 8.0)
    draw(gl, target, HudState(edge=edge, fps=60, length_s=3, live=False, notice="waiting"))
    assert gl.error == "GL_NO_ERROR"
    before = pixels(target).copy()
    draw(gl, target, HudState(edge=EdgeState(False, "tcp://127.0.0.1:5580")), 2.0)
    assert np.abs(pixels(target) - before).max() > 50


def ailing(*severities: Severity) -> EdgeState:
    """Returns the state of an edge with one problem of each severity."""
    states = tuple(
        HealthState("slow", severity, 0, "The sensor sends 5 frames a second instead of 30.", "Use USB 3.")
        for severity in severities
    )
    return EdgeState(True, "tcp://127.0.0.1:5580", "tracking", health=states)


@pytest.mark.parametrize("size", [(1280, 720), (320, 240)])
def test_problems_are_shown_in_the_colour_of_their_severity(gl, size) -> None:
    plain, shown = canvas_of(gl, *size), canvas_of(gl, *size)
    draw(gl, plain, HudState(edge=ailing()))
    draw(gl, shown, HudState(edge=ailing(Severity.ERROR)))
    changed = np.abs(pixels(shown) - pixels(plain)).max(-1) > 20
    rows, columns = np.nonzero(changed)
    assert len(rows) > 500 and columns.max() < size[0] - 14 and rows.max() < size[1] - 60
    stripe = pixels(shown)[rows.min() : rows.max(), 17]
    assert (stripe[:, 0] > stripe[:, 2] + 90).mean() > 0.95, "the stripe of an error is red"


def test_problems_without_space_never_cover_the_timeline(gl) -> None:
    size = (640, 300)
    single, several = canvas_of(gl, *size), canvas_of(gl, *size)
    for target, count in ((single, 1), (several, 8)):
        draw(gl, target, HudState(edge=ailing(*[Severity.WARNING] * count), length_s=3))
    assert np.abs(pixels(single) - pixels(several))[: size[1] - 62].max() > 50
    np.testing.assert_array_equal(pixels(single)[size[1] - 56 :], pixels(several)[size[1] - 56 :])


def test_silent_edge_shows_no_health(gl) -> None:
    size = (640, 360)
    first, second = canvas_of(gl, *size), canvas_of(gl, *size)
    draw(gl, first, HudState(edge=EdgeState(False, "tcp://127.0.0.1:5580")))
    draw(gl, second, HudState(edge=replace(ailing(Severity.ERROR), connected=False, phase="")))
    np.testing.assert_array_equal(pixels(first), pixels(second))


def test_times_are_formatted() -> None:
    assert [format_time(s) for s in (0, 9.96, 61.24, -1)] == ["0:00.0", "0:10.0", "1:01.2", "0:00.0"]
