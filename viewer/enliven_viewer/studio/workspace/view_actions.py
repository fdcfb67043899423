"""The actions of the View menu: bones, text size and theme, and the camera."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from enliven_viewer.language import tr
from enliven_viewer.studio.actions.action import Action
from enliven_viewer.studio.preferences import TEXT_SIZES, Preferences
from enliven_viewer.studio.workspace.commands import Commands
from enliven_viewer.theme import is_light


def make_reading_actions(preferences: Preferences) -> Iterator[Action]:
    """Yields the actions for text size, theme and animation."""

    def at_end(size: float, size_name: str) -> str:
        return tr("The text is as {0} as it gets.", size_name) if preferences.text_size == size else ""

    yield Action(
        "view.larger_text",
        "View",
        "Larger text",
        ("ctrl+shift+equal",),
        lambda: preferences.resize(1),
        lambda: at_end(TEXT_SIZES[-1], tr("large")),
        about="Changes the size of text and of all panels.",
        apart=True,
    )
    yield Action(
        "view.smaller_text",
        "View",
        "Smaller text",
        ("ctrl+shift+minus",),
        lambda: preferences.resize(-1),
        lambda: at_end(TEXT_SIZES[0], tr("small")),
        about="Changes the size of text and of all panels.",
    )
    yield Action(
        "view.light_theme",
        "View",
        "Light theme",
        (),
        lambda: preferences.set_colours("dark" if is_light() else "light"),
        is_on=is_light,
        about="Dark letters on light panels, and a bright stage.",
    )
    yield Action(
        "view.less_motion",
        "View",
        "Less motion",
        (),
        preferences.set_less_motion,
        is_on=lambda: preferences.less_motion,
        about="The view turns immediately, without animation.",
    )
    yield Action(
        "view.performer",
        "View",
        "Camera preview",
        ("alt+p",),
        preferences.watch_performer,
        is_on=lambda: preferences.performer,
        about="Shows the performers as seen by their cameras, side by side if there are several.",
    )


def make_camera_actions(c: Commands) -> Iterator[Action]:
    """Yields the actions for the visibility of bones and for the camera."""
    editor, right = c.editor, np.pi / 2
    yield Action(
        "view.bones", "View", "Bones", ("b",), c.toggle_bones, is_on=lambda: editor.show_bones, apart=True
    )
    yield Action(
        "view.all", "View", "Frame everything", ("f",), lambda: editor.frame_all(reset=False), apart=True
    )
    yield Action(
        "view.way",
        "View",
        "Frame the whole path",
        ("ctrl+f",),
        editor.frame_path,
        about="Shows the whole path of the chosen shape, or of all shapes if none is chosen.",
    )
    yield Action(
        "view.follow",
        "View",
        "Follow the character",
        ("shift+f",),
        editor.camera_moves.toggle_follow,
        is_on=lambda: editor.camera_moves.follow,
        about="The view follows the chosen character, or all characters, and keeps its direction.",
    )
    yield Action(
        "view.turntable",
        "View",
        "Turntable",
        ("shift+t",),
        editor.camera_moves.toggle_turntable,
        is_on=lambda: editor.camera_moves.turntable,
        about="The view goes around slowly.",
    )
    yield Action(
        "view.look",
        "View",
        "Next look",
        ("shift+l",),
        editor.switch_look,
        about="Another light, backdrop and floor: studio, night, white, dawn, garden.",
    )
    sides = (
        ("front", "1", 0.0, 0.0),
        ("back", "2", np.pi, 0.0),
        ("right", "3", right, 0.0),
        ("above", "7", 0.0, right),
    )
    for name, key, around, up in sides:
        label = "From above" if name == "above" else f"From the {name}"
        face = lambda to=(around, up): editor.camera.face(*to)  # noqa: E731
        yield Action(f"view.{name}", "View", label, (key,), face, group="From a side")
    yield Action(
        "view.best",
        "View",
        "Best view of the bones",
        ("v",),
        c.show_best_view,
        c.lacks_shape,
        group="From a side",
        about="Turns the view so that the bones of the chosen shape overlap as little as possible.",
    )
