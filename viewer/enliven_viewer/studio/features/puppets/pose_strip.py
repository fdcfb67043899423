"""The strip of key poses: thumbnails of the puppet, each with the performer at that time."""

from __future__ import annotations

import math
from contextlib import nullcontext

import numpy as np
from imgui_bundle import ImVec2, imgui

from enliven.document import ExampleCharacter
from enliven.modeling.puppet.poses import remove_key_pose
from enliven_viewer.language import later, tr
from enliven_viewer.live.hud import format_time
from enliven_viewer.studio.app.app import App
from enliven_viewer.studio.app.fields import draw_tooltip
from enliven_viewer.studio.app.panel_layout import Area
from enliven_viewer.studio.app.style import (
    draw_note,
    open_panel,
    pack_colour,
    push_colours,
    push_fill,
    use_small_text,
)
from enliven_viewer.studio.features.puppets.key_pose_navigator import KeyPoseNavigator
from enliven_viewer.studio.features.puppets.performer_view import PerformerFigure, PerformerView
from enliven_viewer.studio.features.puppets.thumbnails import SIDE, Thumbnails
from enliven_viewer.studio.puppets.coverage import CoverageCache, TakeCoverage
from enliven_viewer.studio.puppets.example_edits import duplicate_pose, mirror_pose, retime_pose
from enliven_viewer.studio.puppets.puppet_editor import get_puppet_editor
from enliven_viewer.theme import ACCENT, CHAIN, DARK, GLASS, GOOD, INK, LINE, QUIET, RAISED, UNTINTED


def draw_stick_figure(draw_list: imgui.ImDrawList, figure: PerformerFigure, area: Area, colour: int) -> None:
    """Draws a stick figure from its front right, scaled so that its rest pose fits the area."""
    joints, parents, height = figure.joints, figure.skeleton.parents, figure.height
    across = joints[:, 0] * math.cos(SIDE) - joints[:, 2] * math.sin(SIDE)
    scale = area.height / (1.12 * height)
    xs = area.x + area.width / 2 + np.clip(across * scale, -area.width / 2, area.width / 2)
    ys = area.y + area.height - np.clip(joints[:, 1] * scale, 0.0, area.height)
    thick = max(1.3, 0.022 * area.height)
    for joint in range(1, len(joints)):
        up = int(parents[joint])
        if np.hypot(xs[joint] - xs[up], ys[joint] - ys[up]) > 0.6:
            draw_list.add_line(ImVec2(xs[up], ys[up]), ImVec2(xs[joint], ys[joint]), colour, thick)


def draw_dashed_rectangle(draw_list: imgui.ImDrawList, low: ImVec2, high: ImVec2, colour: int) -> None:
    """Draws a dashed rectangle."""
    step = 7.0
    for y in (low.y, high.y):
        for k in range(int((high.x - low.x) / step / 2) + 1):
            x = low.x + 2 * k * step
            draw_list.add_line(ImVec2(x, y), ImVec2(min(x + step, high.x), y), colour, 1.2)
    for x in (low.x, high.x):
        for k in range(int((high.y - low.y) / step / 2) + 1):
            y = low.y + 2 * k * step
            draw_list.add_line(ImVec2(x, y), ImVec2(x, min(y + step, high.y)), colour, 1.2)


TILE_SIZE = ImVec2(88, 80)
_PLUS_ICON = "\uf067"


def draw_strip(app: App, area: Area, thumbnails: Thumbnails) -> None:
    """Draws all key poses in order of time, then the suggested key poses, and buttons for the edited key
    pose.
    """
    puppet = get_puppet_editor(app.editor).puppet
    flags = imgui.WindowFlags_.no_scrollbar | imgui.WindowFlags_.no_scroll_with_mouse
    imgui.push_style_var(imgui.StyleVar_.window_padding, ImVec2(12, 6))
    with open_panel("strip", area, flags):
        imgui.pop_style_var()
        if puppet is None:
            return
        take = app.state(PerformerView).take
        coverage = app.state(CoverageCache).find_coverage(app.editor.project, puppet, take) if take else None
        _draw_head(app, puppet, coverage)
        height = imgui.get_content_region_avail().y
        scroll = imgui.WindowFlags_.horizontal_scrollbar | imgui.WindowFlags_.no_background
        imgui.begin_child("##tiles", ImVec2(0, height), 0, scroll)
        _scroll_with_wheel()
        _draw_add_button(app, puppet)
        order = sorted(range(len(puppet.poses)), key=lambda k: (puppet.poses[k].take, puppet.poses[k].time))
        for place, number in enumerate(order, start=1):
            imgui.same_line()
            _draw_tile(app, puppet, number, place, thumbnails)
        _draw_suggestions(app, puppet, coverage)
        imgui.end_child()


def _scroll_with_wheel() -> None:
    """Scrolls the strip sideways with the wheel."""
    if imgui.is_window_hovered() and imgui.get_io().mouse_wheel:
        imgui.set_scroll_x(imgui.get_scroll_x() - 60 * imgui.get_io().mouse_wheel)


def _draw_head(app: App, puppet: ExampleCharacter, coverage: TakeCoverage | None) -> None:
    """Draws the number of key poses, the number still needed, and buttons for the edited key pose."""
    puppets = get_puppet_editor(app.editor)
    imgui.align_text_to_frame_padding()
    with use_small_text(), push_colours(QUIET, imgui.Col_.text):
        imgui.text_unformatted(tr("KEY POSES   {0}", len(puppet.poses) or ""))
    if coverage is not None and puppet.points:
        imgui.same_line(0, 14)
        with use_small_text(), push_colours(QUIET if coverage.needed else GOOD, imgui.Col_.text):
            imgui.text_unformatted(make_status_text(coverage, len(puppet.poses)))
        if imgui.is_item_hovered():
            imgui.set_tooltip(
                tr(
                    "Shows whether each moment of the take is similar to a key pose.\n"
                    "A dashed picture is a moment that still needs a key pose."
                )
            )
    number = puppets.number
    if number is None:
        return
    imgui.same_line(max(imgui.get_window_width() - 398, 40))
    imgui.push_style_var(imgui.StyleVar_.frame_padding, ImVec2(7, 2))
    _draw_pose_buttons(app, puppet, number)
    imgui.pop_style_var()


def make_status_text(coverage: TakeCoverage, count: int) -> str:
    """Returns the number of key poses that a take still needs, as a text."""
    if count == 0:
        return tr("key poses that {1} needs: about {0}", coverage.needed, coverage.take)
    if coverage.needed == 0:
        return tr("enough for {0}: each moment is similar to a key pose", coverage.take)
    if coverage.needed == 1:
        return tr("{0} needs one more, at the dashed moment", coverage.take)
    return tr("{1} needs {0} more, at the dashed moments", coverage.needed, coverage.take)


def _draw_pose_buttons(app: App, puppet: ExampleCharacter, number: int) -> None:
    """Draws the buttons for the edited key pose."""
    tooltips = {
        "Done": tr("Keeps the key pose, and plays the puppet's motion (Enter)"),
        "Cancel": tr("Restores the old key pose"),
        "Duplicate": tr("Copies the key pose to a moment half a second later"),
        "Mirror": tr("Copies the mirror image of the key pose to a moment half a second later"),
        "Here": tr("Moves the key pose to the playhead"),
        "Remove": tr("Removes this key pose"),
    }
    for place, label in enumerate(tooltips):
        if place:
            imgui.same_line(0, 5)
        with push_fill(ACCENT) if label == "Done" else nullcontext():
            is_pressed = imgui.button(f"{tr(label)}###{label}")
        app.remember(f"pose {label}")
        draw_tooltip(tooltips[label])
        if is_pressed:
            run_pose_command(app, puppet, number, label)


def run_pose_command(app: App, puppet: ExampleCharacter, number: int, label: str) -> None:
    """Runs the command of a button or menu entry on a key pose."""
    editor, key, name = app.editor, puppet.poses[number], puppet.id
    if label == "Done":
        get_puppet_editor(editor).accept()
    elif label == "Cancel":
        get_puppet_editor(editor).cancel()
    elif label == "Edit":
        app.state(KeyPoseNavigator).edit(number)
    elif label == "Remove":
        get_puppet_editor(editor).accept()
        editor.edit("remove a key pose", lambda project: remove_key_pose(project, name, number))
    elif label == "Here":
        moved = app.state(PerformerView).playhead(key.take)
        editor.edit("retime a key pose", lambda project: retime_pose(project, name, number, moved))
    else:
        make = duplicate_pose if label == "Duplicate" else mirror_pose
        moment = _find_free_time(app, puppet, number)
        if editor.edit(_COMMAND_TITLES[label], lambda p: make(p, name, number, key.take, moment)):
            app.state(KeyPoseNavigator).edit(len(puppet.poses))


_COMMAND_TITLES = {"Duplicate": later("duplicate a key pose"), "Mirror": later("mirror a key pose")}
"""The name in the undo history of each command that adds another key pose."""


def _find_free_time(app: App, puppet: ExampleCharacter, number: int) -> float:
    """Returns a time in the take without a key pose. It is half a second after or before key pose ``number``
    if possible.
    """
    key = puppet.poses[number]
    clip = app.editor.project.takes[key.take]
    taken_frames = {round(pose.time / clip.step) for pose in puppet.poses if pose.take == key.take}
    key_frame, aside, last = round(key.time / clip.step), max(round(0.5 / clip.step), 1), len(clip.turns) - 1
    candidates = [key_frame + aside, key_frame - aside, *range(last + 1)]
    free = next((k for k in candidates if 0 <= k <= last and k not in taken_frames), key_frame)
    return free * clip.step


def _draw_add_button(app: App, puppet: ExampleCharacter) -> None:
    """Draws the button that adds a key pose at the time shown in the performer's view."""
    moment = app.state(PerformerView).moment
    origin = imgui.get_cursor_screen_pos()
    imgui.begin_disabled(moment is None or not puppet.points)
    imgui.begin_group()
    is_pressed = imgui.invisible_button("##plus", TILE_SIZE)
    app.remember("add key pose")
    hovered = imgui.is_item_hovered()
    corner = ImVec2(origin.x + TILE_SIZE.x, origin.y + TILE_SIZE.y)
    draw_list = imgui.get_window_draw_list()
    draw_list.add_rect_filled(origin, corner, pack_colour(RAISED, 1.4 if hovered else 0.8), 7.0)
    width = imgui.calc_text_size(_PLUS_ICON).x * 22 / imgui.get_font_size()
    position = ImVec2(origin.x + (TILE_SIZE.x - width) / 2, origin.y + 26)
    draw_list.add_text(imgui.get_font(), 22.0, position, pack_colour(ACCENT if hovered else INK), _PLUS_ICON)
    with use_small_text():
        imgui.text_unformatted(tr("new key pose"))
    imgui.end_group()
    imgui.end_disabled()
    if is_pressed and moment is not None:
        app.state(KeyPoseNavigator).begin(*moment)
    if imgui.is_item_hovered(imgui.HoveredFlags_.allow_when_disabled):
        imgui.set_tooltip(tr("Makes a key pose for this moment"))


def _draw_tile(app: App, puppet: ExampleCharacter, number: int, place: int, thumbnails: Thumbnails) -> None:
    """Draws one key pose. A click edits it."""
    pose, chosen = puppet.poses[number], get_puppet_editor(app.editor).number == number
    origin = imgui.get_cursor_screen_pos()
    imgui.begin_group()
    if imgui.invisible_button(f"##pose {number}", TILE_SIZE):
        app.state(KeyPoseNavigator).edit(number)
    app.remember(f"key pose {place}")
    hovered = imgui.is_item_hovered()
    if imgui.begin_popup_context_item(f"##of pose {number}"):
        _draw_menu(app, puppet, number)
        imgui.end_popup()
    draw_list = imgui.get_window_draw_list()
    corner = ImVec2(origin.x + TILE_SIZE.x, origin.y + TILE_SIZE.y)
    texture = thumbnails.texture(puppet, pose.places, number)
    if texture is None:
        draw_list.add_rect_filled(origin, corner, pack_colour(DARK), 7.0)
    else:
        white = pack_colour(UNTINTED)
        draw_list.add_image_rounded(
            imgui.ImTextureRef(texture), origin, corner, ImVec2(0, 0), ImVec2(1, 1), white, 7.0
        )
    figure = app.state(PerformerView).figure((pose.take, pose.time))
    if figure is not None:
        inset = Area(origin.x + 4, origin.y + TILE_SIZE.y - 38, 26, 34)
        draw_list.add_rect_filled(
            ImVec2(inset.x, inset.y), ImVec2(inset.x + 26, inset.y + 34), pack_colour(GLASS, 0.8), 5.0
        )
        draw_stick_figure(draw_list, figure, inset, pack_colour(INK, 0.95))
    if chosen or hovered:
        draw_list.add_rect(origin, corner, pack_colour(ACCENT if chosen else LINE), 7.0, 2.0)
    with use_small_text():
        if len({key_pose.take for key_pose in puppet.poses}) > 1:
            draw_list.add_text(
                ImVec2(origin.x + 6, origin.y + 4), pack_colour(QUIET), _shorten_name(pose.take)
            )
        imgui.text_unformatted(f"{place}   {format_time(pose.time)}")
    imgui.end_group()


def _draw_menu(app: App, puppet: ExampleCharacter, number: int) -> None:
    """Draws the context menu of a key pose."""
    for label in ("Edit", "Duplicate", "Mirror", "Remove"):
        if imgui.menu_item_simple(f"{tr(label)}###{label}"):
            run_pose_command(app, puppet, number, label)


def _draw_suggestions(app: App, puppet: ExampleCharacter, coverage: TakeCoverage | None) -> None:
    """Draws the performer at the suggested times. A click begins a key pose."""
    if coverage is None or not puppet.points:
        return
    wanted_frames = coverage.frames[: max(coverage.needed, 1)]
    for place, frame in enumerate(wanted_frames):
        imgui.same_line(0, 22 if place == 0 else -1)
        seconds = frame * coverage.step
        origin = imgui.get_cursor_screen_pos()
        imgui.begin_group()
        if imgui.invisible_button(f"##ghost {place}", TILE_SIZE):
            app.state(KeyPoseNavigator).begin(coverage.take, seconds)
        app.remember(f"suggested {place + 1}")
        hovered = imgui.is_item_hovered()
        draw_list = imgui.get_window_draw_list()
        corner = ImVec2(origin.x + TILE_SIZE.x, origin.y + TILE_SIZE.y)
        draw_dashed_rectangle(draw_list, origin, corner, pack_colour(CHAIN, 0.9 if hovered else 0.5))
        figure = app.state(PerformerView).figure((coverage.take, seconds))
        if figure is not None:
            figure_area = Area(origin.x + 10, origin.y + 6, TILE_SIZE.x - 20, TILE_SIZE.y - 12)
            draw_stick_figure(draw_list, figure, figure_area, pack_colour(CHAIN, 0.95 if hovered else 0.6))
        with use_small_text(), push_colours((*CHAIN[:3], 0.85), imgui.Col_.text):
            imgui.text_unformatted(tr("suggested  {0}", format_time(seconds)))
        imgui.end_group()
        if hovered:
            imgui.set_tooltip(tr("Makes a key pose for this moment. No key pose is similar to it yet"))
    if not wanted_frames:
        imgui.same_line()
        draw_note("")


def _shorten_name(take: str) -> str:
    return take if len(take) <= 12 else f"{take[:11]}..."
