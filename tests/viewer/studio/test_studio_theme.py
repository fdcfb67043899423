"""Tests of themes and colour sets: text is readable on every background, and neighbours differ for all
eyes.
"""

from __future__ import annotations

import ast
import itertools
from pathlib import Path

import numpy as np
import pytest
from in_a_window import in_a_window

import enliven_viewer
from enliven_viewer import theme
from enliven_viewer.studio.app.style import ACCENT_OPACITY_UNDER_TEXT
from enliven_viewer.studio.editor.editor import Editor
from enliven_viewer.studio.preferences import Preferences
from enliven_viewer.studio.workspace.workspace import Workspace
from enliven_viewer.theme import COLOUR_SETS, THEMES, get_theme, use_theme

SESSION = Path(__file__).parents[1] / "studio_theme_session.py"
LEAST_CONTRAST = 4.5
"""Minimum contrast by WCAG 2.2, success criterion 1.4.3, level AA: text of normal size."""
TEXTS = ("ink", "quiet", "accent", "good", "wait", "bad", "chain")
PAINTING = ("tinted", "push_style_color")
SOLID = ("panel", "dark", "popup")
LEAST_APART = 30.0
"""Minimum CIELAB distance of neighbouring colours. It is far above the just noticeable 2.3, because bars are
thin.
"""
LEAST_TOLD = 15.0
"""Minimum CIELAB distance of any two colours of a set."""
CONFUSED = {
    "none": np.eye(3),
    "protanopia": np.array(
        [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]]
    ),
    "deuteranopia": np.array(
        [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]]
    ),
    "tritanopia": np.array(
        [[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602], [0.004733, 0.691367, 0.303900]]
    ),
}
"""Linear sRGB as seen without one kind of cone.

G. M. Machado, M. M. Oliveira, L. A. F. Fernandes, "A Physiologically-based Model for Simulation of Color
Vision Deficiency", IEEE TVCG 15(6), 2009.
"""
XYZ = np.array(
    [[0.4124564, 0.3575761, 0.1804375], [0.2126729, 0.7151522, 0.0721750], [0.0193339, 0.1191920, 0.9503041]]
)


def linear(shown) -> np.ndarray:
    """Returns (..., 3) linear light of sRGB 0..1."""
    shown = np.asarray(shown, float)
    return np.where(shown <= 0.04045, shown / 12.92, ((shown + 0.055) / 1.055) ** 2.4)


def over(colour, ground) -> np.ndarray:
    """Returns (3,) the sRGB of a translucent colour over an opaque one, mixed as by the graphics card."""
    colour, opacity = np.asarray(colour[:3], float), colour[3] if len(colour) > 3 else 1.0
    return opacity * colour + (1.0 - opacity) * np.asarray(ground[:3], float)


def contrast(text, ground) -> float:
    """Returns the WCAG 2.2 contrast ratio between a translucent text and an opaque ground, 1..21."""
    bright = [float(linear(colour) @ XYZ[1]) for colour in (over(text, ground), ground[:3])]
    return (max(bright) + 0.05) / (min(bright) + 0.05)


def lab(light) -> np.ndarray:
    """Returns (..., 3) CIELAB of linear sRGB."""
    share = (np.clip(light, 0, 1) @ XYZ.T) / XYZ.sum(1)
    f = np.where(share > (6 / 29) ** 3, np.cbrt(share), share / (3 * (6 / 29) ** 2) + 4 / 29)
    return np.stack(
        [116 * f[..., 1] - 16, 500 * (f[..., 0] - f[..., 1]), 200 * (f[..., 1] - f[..., 2])], axis=-1
    )


def apart(colours) -> np.ndarray:
    """Returns (N, N) CIELAB distances of sRGB colours 0..255, for the type of vision with the smallest
    difference.
    """
    colours_seen = [lab(linear(np.asarray(colours) / 255) @ matrix.T) for matrix in CONFUSED.values()]
    return np.min(
        [np.linalg.norm(shades[:, None] - shades[None], axis=-1) for shades in colours_seen], axis=0
    )


def test_colour_measures_match_their_publications() -> None:
    assert contrast((0.0, 0.0, 0.0, 1.0), (1.0, 1.0, 1.0)) == pytest.approx(21.0)
    assert contrast((0.4666667,) * 3, (1.0, 1.0, 1.0)) == pytest.approx(4.48, abs=0.01)  # the well-known #777
    assert lab(linear([1.0, 0.0, 0.0])) == pytest.approx([53.24, 80.09, 67.20], abs=0.05)
    red_and_green = apart([(200, 60, 60), (90, 118, 60)])[0, 1]
    assert (
        red_and_green
        < 30
        < np.linalg.norm(np.diff(lab(linear([[0.784, 0.235, 0.235], [0.353, 0.463, 0.235]])), axis=0))
    )


@pytest.mark.parametrize("name", THEMES)
def test_every_text_is_readable_on_every_ground(name) -> None:
    colours = THEMES[name]
    grounds = {ground: getattr(colours, ground) for ground in SOLID}
    grounds["a popup over white"] = over(colours.popup, (1.0,) * 3)
    pairs = [(text, getattr(colours, text), *ground) for text in TEXTS for ground in grounds.items()]
    pairs += [("faint", colours.faint, *ground) for ground in grounds.items()]
    for text in ("ink", "quiet", "accent"):
        pairs += [(text, getattr(colours, text), "raised", colours.raised)]
        chosen = over((*colours.accent[:3], 0.22), colours.panel)
        pairs += [(text, getattr(colours, text), "a chosen row", chosen)] if text != "quiet" else []
    for opacity in (0.40, 0.45):
        button = over((*colours.accent[:3], opacity), colours.panel)
        pairs.append(("ink", colours.ink, f"a tinted button of {opacity}", button))
    pairs.append(("ink", colours.ink, "pressed", colours.pressed))
    for fill in ("accent", "good", "wait", "bad"):
        pairs.append(("the ink on fills", getattr(colours, theme.ON_FILL.name), fill, getattr(colours, fill)))
    for track in ("raised", "pressed"):
        grab = over((*colours.accent[:3], ACCENT_OPACITY_UNDER_TEXT), getattr(colours, track))
        pairs.append(("ink", colours.ink, f"a slider or progress on {track}", grab))
    # Texts over the stage are tested on its default look. Texts in every look are also tested on black and
    # white.
    stage = (0.30, 0.33, 0.38) if name == "dark" else (0.74, 0.75, 0.77)
    glass = over(colours.glass, stage)
    pairs += [(text, getattr(colours, text), "glass over the stage", glass) for text in TEXTS[:3]]
    for picture in ((0.0,) * 3, (1.0,) * 3):
        dense = over((*colours.glass[:3], 0.85), picture)
        pairs += [(text, getattr(colours, text), f"dense glass over {picture}", dense) for text in TEXTS[:2]]
        warning = over((*colours.glass[:3], 0.92), picture)
        pairs.append(("bad", colours.bad, f"a warning over {picture}", warning))
    for text, colour, ground, shown in pairs:
        ratio = contrast(colour, shown)
        assert ratio >= LEAST_CONTRAST, f"{name}: {text} on {ground} has a contrast of {ratio:.2f}"


@pytest.mark.parametrize("name", COLOUR_SETS)
def test_names_on_bars_of_the_timeline_are_readable(name) -> None:
    for colour in (*COLOUR_SETS[name].lanes, COLOUR_SETS[name].contact, COLOUR_SETS[name].flight):
        assert contrast(theme.ON_COLOUR, np.array(colour) / 255) >= LEAST_CONTRAST, colour


@pytest.mark.parametrize("part", ["limbs", "performers", "lanes", "points", "characters"])
def test_the_colours_of_okabe_and_ito_differ_for_all_eyes(part) -> None:
    colours = getattr(COLOUR_SETS["okabe-ito"], part)
    distances = apart(colours)
    neighbours = [distances[k, (k + 1) % len(colours)] for k in range(len(colours))]
    assert min(neighbours) >= LEAST_APART
    assert distances[np.triu_indices(len(colours), 1)].min() >= LEAST_TOLD
    assert len(colours) == len(getattr(COLOUR_SETS["usual"], part))


def test_ground_and_air_differ_for_all_eyes_in_the_safe_set() -> None:
    chosen = COLOUR_SETS["okabe-ito"]
    assert apart([chosen.contact, chosen.flight])[0, 1] >= LEAST_APART


def test_a_theme_changes_at_once_and_is_kept(tmp_path) -> None:
    workspace = Workspace.new(Editor(), tmp_path)
    assert get_theme() == ("dark", "usual")
    dark, lane = tuple(theme.PANEL), tuple(theme.LANE_COLOURS[0])
    assert workspace.actions.do("view.light_theme") and workspace.actions["view.light_theme"].is_on()
    workspace.preferences.set_colours(colours="okabe-ito")
    assert tuple(theme.PANEL) == THEMES["light"].panel != dark and tuple(theme.LANE_COLOURS[0]) != lane
    use_theme("dark", "usual")
    again = Preferences(tmp_path)
    assert (again.theme, again.colours) == get_theme() == ("light", "okabe-ito")
    workspace.actions.do("view.light_theme")
    assert get_theme() == ("dark", "okabe-ito")


def test_unknown_theme_falls_back_to_the_default(tmp_path) -> None:
    (tmp_path / "preferences.json").write_text('{"theme": "neon", "colours": 7}')
    assert Preferences(tmp_path).theme == "dark"  # damaged preferences are put aside
    (tmp_path / "preferences.json").write_text('{"theme": "neon", "colours": "none"}')
    preferences = Preferences(tmp_path)
    assert (preferences.theme, preferences.colours) == get_theme() == ("dark", "usual")


def test_no_module_of_the_window_has_colours_of_its_own() -> None:
    home = Path(enliven_viewer.__file__).parent
    drawing = {"packed", "tinted", "Colour", "ImVec4"}
    for path in itertools.chain(home.glob("studio/**/*.py"), home.glob("live/**/*.py")):
        for node in ast.walk(ast.parse(path.read_text("utf-8"))):
            parts = []
            if isinstance(node, ast.Call) and getattr(node.func, "id", "") in drawing:
                parts = node.args
            elif isinstance(node, ast.AnnAssign) and "Colour" in ast.unparse(node.annotation) and node.value:
                parts = [node.value]
            for part in parts:
                numbers = [
                    node
                    for node in ast.walk(part)
                    if isinstance(node, ast.Tuple)
                    and len(node.elts) in (3, 4)
                    and all(isinstance(each, ast.Constant) for each in node.elts)
                ]
                assert not numbers, f"{path}:{node.lineno}: take the colour from enliven_viewer.theme"


def test_full_colour_buttons_use_a_readable_text_colour() -> None:
    """Buttons are filled by ``filled`` only, because ``tinted`` would leave the default text colour."""
    full, kinds = {"ACCENT", "GOOD", "WAIT", "BAD"}, ("button", "plot_histogram", "slider_grab", "frame_bg")
    for path in Path(enliven_viewer.__file__).parent.glob("studio/panels/**/*.py"):
        for node in ast.walk(ast.parse(path.read_text("utf-8"))):
            if not (isinstance(node, ast.Call) and ast.unparse(node.func).endswith(PAINTING)):
                continue
            parts = [ast.unparse(part) for part in node.args]
            fills = [part for part in parts if part.startswith("imgui.Col_.") and part[11:].startswith(kinds)]
            plain = [
                part for part in parts if part in full or part in {f"packed({colour})" for colour in full}
            ]
            assert not (fills and plain), f"{path}:{node.lineno}: fill the button with style.filled"


@pytest.mark.slow
def test_both_themes_are_drawn_in_three_workspaces(tmp_path) -> None:
    shown = in_a_window(SESSION, str(tmp_path))
    for name, colours in THEMES.items():
        for room in ("Perform", "Animate", "Model"):
            report = shown[f"{name} {room}"]
            np.testing.assert_allclose(np.array(report["panel"]) / 255, colours.panel[:3], atol=0.006)
            bright = float(linear(np.array(report["stage"]) / 255) @ XYZ[1])
            assert (bright > 0.35) == (name == "light"), (name, room, bright)
            assert report["inks"] > 200, f"{name} {room}: the side panel has no letters"
