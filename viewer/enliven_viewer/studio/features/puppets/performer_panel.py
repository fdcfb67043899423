"""The second view: the performer next to the puppet. A click on a joint pairs it with the selected point."""

from __future__ import annotations

from imgui_bundle import ImVec2, imgui

from enliven_viewer.language import labelled, tr
from enliven_viewer.live.hud import format_time
from enliven_viewer.studio.app.app import App
from enliven_viewer.studio.app.fields import draw_tooltip
from enliven_viewer.studio.app.marks import draw_mark, make_axes_marks
from enliven_viewer.studio.app.panel_layout import Area
from enliven_viewer.studio.app.style import draw_note, open_panel, pack_colour, use_small_text
from enliven_viewer.studio.features.puppets.performer_view import PerformerView
from enliven_viewer.studio.puppets.example_edits import find_layer_number
from enliven_viewer.studio.puppets.puppet_editor import get_puppet_editor
from enliven_viewer.theme import ACCENT, DARK, GLASS, INK, LINE, QUIET

_MIN_ARROW_WIDTH = 110.0
"""A take field narrower than this, in pixels, has no arrow, because the name needs the space."""
_LINK_ICON = "\uf0c1"


def draw_performer(app: App, area: Area, texture: int | None) -> None:
    """Draws the performer, the take field, and the name of the hovered joint."""
    imgui.push_style_var(imgui.StyleVar_.window_padding, ImVec2(0, 0))
    flags = imgui.WindowFlags_.no_scrollbar | imgui.WindowFlags_.no_scroll_with_mouse
    with open_panel("performer", area, flags):
        imgui.pop_style_var()
        view = app.state(PerformerView)
        view.size = (area.width, area.height)
        origin = imgui.get_cursor_screen_pos()
        _draw_picture(app, origin, area, texture)
        imgui.set_cursor_screen_pos(ImVec2(origin.x + 12, origin.y + 12))
        _draw_bar(app, area)
        _draw_texts(app, origin, area)


def _draw_bar(app: App, area: Area) -> None:
    """Draws the take field, the button that plays the take, and the button that links both views."""
    view, puppet = app.state(PerformerView), get_puppet_editor(app.editor).puppet
    takes = app.editor.project.takes
    unused = (
        puppet is not None and view.take is not None and find_layer_number(puppet, None, view.take) is None
    )
    width = max(area.width - (152 if unused else 66), 60)
    imgui.set_next_item_width(width)
    flags = imgui.ComboFlags_.no_arrow_button if width < _MIN_ARROW_WIDTH else imgui.ComboFlags_.none
    if imgui.begin_combo("##performer take", view.take or tr("choose a take"), flags):
        for name, take in takes.items():
            if imgui.selectable(f"{name}   {take.duration:.1f} s###take {name}", name == view.take)[0]:
                view.show(name)
            app.remember(f"pick {name}")
        if not takes:
            draw_note("No takes yet. Press Ctrl+O to open a take.")
        imgui.end_combo()
    app.remember("takes")
    if unused:
        imgui.same_line()
        if imgui.button(labelled(tr("Play it"), "Play it"), ImVec2(78, 0)):
            view.play()
        app.remember("play take")
        draw_tooltip("Adds this take as a layer, so that the puppet also plays it")
    imgui.same_line()
    if view.linked:
        imgui.push_style_color(imgui.Col_.text, pack_colour(ACCENT))
    linked = view.linked
    if imgui.button(_LINK_ICON + "##linked", ImVec2(30, 0)):
        view.linked = not view.linked
    if linked:
        imgui.pop_style_color()
    app.remember("linked")
    draw_tooltip("Turns both views together")


def _draw_picture(app: App, origin: ImVec2, area: Area, texture: int | None) -> None:
    view, size = app.state(PerformerView), ImVec2(area.width, area.height)
    imgui.set_next_item_allow_overlap()
    imgui.invisible_button("##performer", size)
    app.remember("performer")
    draw_list = imgui.get_window_draw_list()
    corner = ImVec2(origin.x + size.x, origin.y + size.y)
    if texture is not None and view.moment is not None:
        draw_list.add_image(imgui.ImTextureRef(texture), origin, corner, ImVec2(0, 1), ImVec2(1, 0))
    else:
        draw_list.add_rect_filled(origin, corner, pack_colour(DARK))
    draw_list.add_line(ImVec2(corner.x - 1, origin.y), ImVec2(corner.x - 1, corner.y), pack_colour(LINE), 2.0)
    pointer = imgui.get_mouse_pos()
    place = (pointer.x - origin.x, pointer.y - origin.y)
    if imgui.is_item_activated():
        view.press(place)
    if imgui.is_item_hovered() or imgui.is_item_active():
        view.move(place)
        if imgui.get_io().mouse_wheel:
            view.wheel(imgui.get_io().mouse_wheel)
    else:
        view.hovered = None
    if imgui.is_item_deactivated():
        view.release()


def _draw_texts(app: App, origin: ImVec2, area: Area) -> None:
    """Draws the time and the hovered joint, or instructions if no take is shown."""
    view, moment = app.state(PerformerView), app.state(PerformerView).moment
    draw_list = imgui.get_window_draw_list()
    if moment is not None:
        for mark in make_axes_marks(view.lens, (46, area.height - 42)):
            draw_mark(draw_list, area, mark)
    if moment is None:
        lines = (tr("No take yet."), tr("Open a take (Ctrl+O), or choose a take above."))
        for row, line in enumerate(lines):
            width = imgui.calc_text_size(line).x
            position = ImVec2(origin.x + (area.width - width) / 2, origin.y + area.height / 2 - 20 + 22 * row)
            draw_list.add_text(position, pack_colour(INK if row == 0 else QUIET), line)
        return
    with use_small_text():
        label = tr("the performer at {0}", format_time(moment[1]))
        width = imgui.calc_text_size(label).x + 18
        if width + 12 > area.width:
            label = format_time(moment[1])
            width = imgui.calc_text_size(label).x + 18
        low = origin.y + area.height - 32
        left = origin.x + area.width - width - 12
        draw_list.add_rect_filled(ImVec2(left, low), ImVec2(left + width, low + 22), pack_colour(GLASS), 7.0)
        draw_list.add_text(ImVec2(left + 9, low + 4), pack_colour(QUIET), label)
        figure = view.figure()
        if view.hovered is not None and figure is not None:
            x, y = view.lens.project(figure.joints)[0][view.hovered]
            name = figure.skeleton.names[view.hovered]
            point = get_puppet_editor(app.editor).point
            puppet = get_puppet_editor(app.editor).puppet
            if point is not None and puppet is not None:
                name = tr("{0} follows {1}", puppet.points[point].name, name)
            width = imgui.calc_text_size(name).x + 14
            x = min(x + 12, area.width - width - 6)
            corner = ImVec2(origin.x + x, origin.y + y - 11)
            draw_list.add_rect_filled(
                corner, ImVec2(corner.x + width, corner.y + 22), pack_colour(GLASS), 6.0
            )
            draw_list.add_text(ImVec2(corner.x + 7, corner.y + 4), pack_colour(INK), name)
