"""The examples panel: the missing inputs of the selected puppet, its control points, its layers, and its
settings.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from imgui_bundle import ImVec2, imgui

from enliven.document import ExampleCharacter
from enliven.modeling.edits import get_rig_edits
from enliven_viewer.language import tr
from enliven_viewer.studio.app.app import App
from enliven_viewer.studio.app.fields import draw_character_name, draw_tooltip
from enliven_viewer.studio.app.panel_layout import Area
from enliven_viewer.studio.app.style import (
    open_panel,
    pack_colour,
    push_colours,
    push_fill,
    use_small_text,
)
from enliven_viewer.studio.app.transform_fields import draw_transform_fields
from enliven_viewer.studio.features.puppets.constraints import draw_constraints
from enliven_viewer.studio.features.puppets.key_pose_navigator import KeyPoseNavigator
from enliven_viewer.studio.features.puppets.performer_view import PerformerView
from enliven_viewer.studio.features.puppets.points_panel import draw_points, suggest_points
from enliven_viewer.studio.features.puppets.solver_settings import draw_settings
from enliven_viewer.studio.puppets.example_edits import find_layer_number, with_guessed_joints
from enliven_viewer.studio.puppets.puppet_editor import get_puppet_editor
from enliven_viewer.theme import ACCENT, BAD, GOOD, INK, QUIET, RAISED, Colour

_BACK_ICON = "\uf060"
_PADDING = 10.0
"""Distance in pixels between the border of the status box and its text."""
_NEXT_HEIGHT = 30.0
"""Height in pixels of the next-step button: easy to hit."""
_STATUS_HEIGHT = 66.0
"""Fixed height in pixels of the status box: a title and two lines; more text scrolls."""


def draw_examples(app: App, area: Area) -> None:
    """Draws the panel of the selected puppet at the right."""
    puppet = get_puppet_editor(app.editor).puppet
    with open_panel("side", area):
        if puppet is None:
            return
        _draw_head(app, puppet)
        draw_status(app, puppet)
        _draw_next_step(app, puppet)
        draw_points(app, puppet)
        puppet = get_puppet_editor(app.editor).puppet
        number = None if puppet is None else find_layer_number(puppet, app.editor.selection.layer)
        if puppet is not None and number is not None:
            for draw_section in app.layer_sections:
                draw_section(puppet, number)
            draw_constraints(app, puppet)
        if puppet is not None:
            draw_transform_fields(app)
            draw_settings(app, puppet)


def _draw_head(app: App, puppet: ExampleCharacter) -> None:
    """Draws the button back to the side panel, and the puppet's name."""
    if imgui.button(_BACK_ICON, ImVec2(30, 0)):
        get_puppet_editor(app.editor).accept()
        app.editor.select_only(None)
    app.remember("all shapes")
    draw_tooltip("Closes this panel, and shows the list of all shapes")
    imgui.same_line()
    draw_character_name(app, puppet)


def _draw_next_step(app: App, puppet: ExampleCharacter) -> None:
    """Draws the highlighted button of the next step. It is always at the same position."""
    label, description, act = _find_next_step(app, puppet)
    with push_fill(ACCENT):
        if imgui.button(f"{label}###next step", ImVec2(-1, _NEXT_HEIGHT)):
            act()
    app.remember("next step")
    draw_tooltip(description)


def _find_next_step(app: App, puppet: ExampleCharacter) -> tuple[str, str, Callable[[], object]]:
    """Returns the next step for a puppet: label, description and command."""
    editor, take = app.editor, app.state(PerformerView).take
    if get_puppet_editor(editor).number is not None:
        return (
            tr("Done"),
            tr("Keeps the key pose, and plays the puppet's motion  (Enter)"),
            get_puppet_editor(editor).accept,
        )
    if not puppet.points:
        points_hint = tr(
            "Puts control points at the ends of the limbs. Or click the surface to put your own points"
        )
        return tr("Suggest points"), points_hint, lambda: suggest_points(app, puppet)
    if take is None:
        take_hint = tr("Opens a take: a performer's motion that the puppet follows")
        return tr("Open a take..."), take_hint, partial(app.actions.do, "file.open")
    if any(not point.joint for point in puppet.points):
        guess = lambda project: with_guessed_joints(project, puppet.id, take)  # noqa: E731
        joints_hint = tr("Pairs every control point with the performer's joint at a similar place")
        return tr("Guess joints"), joints_hint, lambda: editor.edit("guess joints", guess)
    pose_hint = tr("Begins a key pose for this moment of the take. Drag the puppet's control points")
    begin = partial(app.state(KeyPoseNavigator).begin, take, app.state(PerformerView).playhead(take))
    return tr("Pose it here"), pose_hint, begin


def draw_status(app: App, puppet: ExampleCharacter) -> None:
    """Shows the missing inputs of the puppet, or the error that prevents its motion, or that it can move."""
    project, solving = app.editor.project, get_puppet_editor(app.editor).motion_solver
    lacking, problem = get_rig_edits(puppet).find_missing_data(project, puppet), solving.problem(puppet.id)
    if lacking:
        _draw_box(app, ACCENT, tr("Needed before the puppet moves"), _merge_pairing_sentences(lacking))
    elif problem is not None:
        _draw_box(app, BAD, tr("The puppet cannot move"), (problem.what, problem.remedy))
    else:
        count = len(puppet.poses)
        doubled = tr(" and their mirror images") if puppet.symmetry is not None else ""
        _draw_box(
            app, GOOD, tr("The puppet moves"), (tr("The motion blends {0} key poses{1}.", count, doubled),)
        )


def _merge_pairing_sentences(lacking: tuple[str, ...]) -> tuple[str, ...]:
    """Returns the sentences, with those about pairing merged into one. Several sentences would need too much
    space in the panel.
    """
    pairs = [line for line in lacking if line.startswith("Pair ")]
    if len(pairs) < 3:
        return lacking
    first = pairs[0].removeprefix("Pair ").removesuffix(" with a joint.")
    gathered = tr("Pair {0} and {1} other points with joints.", first, len(pairs) - 1)
    return (gathered, *(line for line in lacking if line not in pairs))


def _draw_box(app: App, tint: Colour, title: str, lines: tuple[str, ...]) -> None:
    """Draws a raised box with a coloured border and a fixed height."""
    imgui.dummy(ImVec2(0, 2))
    origin, width = imgui.get_cursor_screen_pos(), imgui.get_content_region_avail().x
    corner = ImVec2(origin.x + width, origin.y + _STATUS_HEIGHT)
    draw_list = imgui.get_window_draw_list()
    draw_list.add_rect_filled(origin, corner, pack_colour(RAISED, 0.75), 7.0)
    low = ImVec2(origin.x + 3, origin.y + 8), ImVec2(origin.x + 6, corner.y - 8)
    draw_list.add_rect_filled(*low, pack_colour(tint), 2.0)
    imgui.push_style_var(imgui.StyleVar_.window_padding, ImVec2(_PADDING + 4, 6))
    imgui.begin_child("##status", ImVec2(0, _STATUS_HEIGHT), imgui.ChildFlags_.always_use_window_padding)
    imgui.pop_style_var()
    with push_colours(tint, imgui.Col_.text):
        imgui.text_unformatted(title)
    with use_small_text(), push_colours(INK if tint is not GOOD else QUIET, imgui.Col_.text):
        imgui.push_text_wrap_pos(0.0)
        for line in (line for line in lines if line):
            imgui.text_unformatted(line)
        imgui.pop_text_wrap_pos()
    imgui.end_child()
    app.widgets["status"] = (origin.x, origin.y, corner.x, corner.y)
