"""The panel of a scan, and the instructions over the view for the person that carries the camera."""

from __future__ import annotations

from imgui_bundle import ImVec2, imgui

from enliven.wire import ScanMessage
from enliven_viewer.language import labelled, later, tr
from enliven_viewer.studio.panel_layout import Area
from enliven_viewer.studio.panels.fields import tooltip
from enliven_viewer.studio.panels.style import draw_heading, draw_note, open_panel, pack_colour, push_colours
from enliven_viewer.studio.panels.viewport_overlay import draw_mark
from enliven_viewer.studio.scan import (
    KeptPart,
    ScanMode,
    ScanSession,
    ScanSize,
    choose_advice,
    make_scan_marks,
)
from enliven_viewer.studio.workspace import Workspace
from enliven_viewer.theme import ACCENT, BAD, GLASS, GOOD, INK, WAIT, Colour

_FULL_WIDTH = ImVec2(-1, 0)
_TALL_BUTTON_SIZE = ImVec2(-1, 38)
_ADVICE_TEXT_SIZE = 34.0
"""Text size in pixels of the instructions: readable from three metres, with a camera in the hands."""
ADVICE_BOTTOM = 72.0
"""Distance in pixels from the top of the view to the lower end of the instructions."""
_SIZE_LABELS: dict[ScanSize, str] = {
    "small": later("Something small: a cup, a shoe"),
    "thing": later("A chair, a lamp"),
    "room": later("A room, or a large object"),
}
_MODE_LABELS: dict[ScanMode, tuple[str, str]] = {
    "round": (
        later("The camera goes round it"),
        later("Once, a metre and a half away; the object stays in its place"),
    ),
    "laid": (
        later("Twice: upright, then laid down"),
        later("Go round it once, lay it on its back or side, take your hands off, and go round again"),
    ),
    "spun": (
        later("The object turns, the room is in view"),
        later("Let it stand for a second, then turn it slowly on a turntable"),
    ),
    "turned": (
        later("The camera stands still, you turn the object"),
        later("On a turntable or in the hands; the wall more than 1.5 m from the camera"),
    ),
    "person": (
        later("A person turns round"),
        later(
            "One to three metres away, whole in view, arms off the sides; once round in five seconds or more"
        ),
    ),
}
_KEPT_PART_LABELS: dict[KeptPart, str] = {
    "thing": later("Only the object on the floor"),
    "box": later("Only the inside of the box"),
    "all": later("Everything that was scanned"),
}
_REQUIREMENTS_HEIGHT = 54.0
"""Height in pixels of the text about requirements of a scan: three lines."""
_BUTTONS_HEIGHT_BEFORE = 58.0
"""Height in pixels of the two buttons at the bottom before a scan."""
_BUTTONS_HEIGHT_DURING = 102.0
"""Height in pixels of the three buttons at the bottom during a scan, one of them tall."""
_PROGRESS_HEIGHT = 76.0
"""Height in pixels of the box with a scan's progress: a line, the bar, and a sentence. More text scrolls."""
_TALL_PROGRESS_HEIGHT = 140.0
"""The same height if the panel has space for the notes of the scan, too."""
_MIN_TALL_PANEL_HEIGHT = 520.0
"""Minimum height in pixels of a panel with that space."""
_MOOD_COLOURS: dict[str, Colour] = {"good": GOOD, "wait": WAIT, "bad": BAD}


def draw_scan(workspace: Workspace, area: Area) -> None:
    """Draws the panel at the right. The buttons that end a scan stay at its bottom, and the rest scrolls.

    The button that starts a scan is at the top. During a scan nothing can be clicked there, so that a double
    click only starts it.
    """
    scan = workspace.scan
    with open_panel("scan", area):
        imgui.begin_child(
            "##rest", ImVec2(0, -(_BUTTONS_HEIGHT_DURING if scan.active else _BUTTONS_HEIGHT_BEFORE))
        )
        if scan.active:
            _draw_running_scan(
                workspace,
                scan,
                _TALL_PROGRESS_HEIGHT if area.height > _MIN_TALL_PANEL_HEIGHT else _PROGRESS_HEIGHT,
            )
        else:
            _draw_start_options(workspace, scan)
        imgui.end_child()
        if scan.active:
            _draw_end(workspace, scan)
        else:
            _draw_again(workspace, scan)
        if imgui.button(labelled(tr("Back to the stage"), "Back to the stage"), _FULL_WIDTH):
            scan.shown = False
        workspace.remember("scan back")


def _draw_start_options(workspace: Workspace, scan: ScanSession) -> None:
    """Draws the options before a scan."""
    draw_heading("Scan")
    lacking = tr(scan.lacks_stage())
    imgui.begin_disabled(bool(lacking))
    with push_colours((*ACCENT[:3], 0.4), imgui.Col_.button):
        if imgui.button(labelled("\uf030  " + tr("Start"), "Start"), _TALL_BUTTON_SIZE):
            workspace.actions.do("scan.start")
    workspace.remember("scan start")
    imgui.end_disabled()
    imgui.begin_child("##before", ImVec2(0, _REQUIREMENTS_HEIGHT))
    if lacking:
        with push_colours(WAIT, imgui.Col_.text):
            imgui.push_text_wrap_pos(0.0)
            imgui.text_unformatted(lacking.partition(". ")[0])
            imgui.pop_text_wrap_pos()
        draw_note(lacking.partition(". ")[2])
    else:
        draw_note("Carry the camera round an object once, 1.5 m away, and it becomes a character.")
    imgui.end_child()
    draw_heading("What is it?")
    imgui.set_next_item_width(-1)
    opened = imgui.begin_combo("##scan size", tr(_SIZE_LABELS[scan.size]))
    workspace.remember("scan size")
    if opened:
        for size, label in _SIZE_LABELS.items():
            if imgui.selectable(f"{tr(label)}###size {size}", scan.size == size)[0]:
                scan.size = size
            workspace.remember(f"scan {size}")
        imgui.end_combo()
    draw_heading("How?")
    for mode, (label, tip) in _MODE_LABELS.items():
        if imgui.radio_button(f"{tr(label)}###way {mode}", scan.mode == mode):
            scan.mode = mode
        workspace.remember(f"scan {mode}")
        tooltip(tip)
    draw_heading("Its name")
    imgui.set_next_item_width(-1)
    scan.name = imgui.input_text_with_hint("##scan name", "scan", scan.name)[1]
    workspace.remember("scan name")


def _draw_again(workspace: Workspace, scan: ScanSession) -> None:
    """Draws the button that continues the last scan."""
    imgui.begin_disabled(bool(scan.lacks_again()))
    again = tr("Add to {0}", scan.message.character or tr("the last scan"))
    if imgui.button(labelled(again, "again"), _FULL_WIDTH):
        workspace.actions.do("scan.again")
    imgui.end_disabled()
    workspace.remember("scan again")
    tooltip("Go on scanning to fill gaps: lay it on its side, or look from below")


def _draw_running_scan(workspace: Workspace, scan: ScanSession, height: float) -> None:
    """Draws the progress, in a box ``height`` pixels high, and the commands of a running scan."""
    status = scan.message
    draw_heading("Scan")
    imgui.begin_child("##progress", ImVec2(0, height), imgui.ChildFlags_.frame_style)
    _draw_progress(status)
    imgui.end_child()
    workspace.remember("scan progress")
    draw_heading("Go on")
    making = status.phase == "finishing"
    imgui.begin_disabled(making)
    label = tr("\uf04c  Pause") if status.phase == "scanning" else tr("\uf04b  Go on")
    half = ImVec2((imgui.get_content_region_avail().x - imgui.get_style().item_spacing.x) / 2, 0)
    if imgui.button(f"{label}###pause", half):
        workspace.actions.do("scan.pause")
    workspace.remember("scan pause")
    imgui.same_line()
    imgui.begin_disabled(status.undoable <= 0)
    if imgui.button(labelled("\uf0e2  " + tr("Undo"), "Undo"), half):
        workspace.actions.do("scan.undo")
    workspace.remember("scan undo")
    tooltip(
        tr(
            "Removes the last {0:.0f} seconds, for example after a hand came into view",
            status.undoable,
        )
    )
    imgui.end_disabled()
    if status.thing != "person":
        _draw_kept_part(workspace, scan)
    imgui.end_disabled()


def _draw_end(workspace: Workspace, scan: ScanSession) -> None:
    """Draws the buttons that end a scan: Done makes a character, Cancel discards the scan."""
    making = scan.message.phase == "finishing"
    imgui.begin_disabled(making)
    with push_colours((*GOOD[:3], 0.4), imgui.Col_.button):
        if imgui.button(
            labelled(tr("It becomes a character..."), "done")
            if making
            else labelled("\uf00c  " + tr("Done"), "done"),
            _TALL_BUTTON_SIZE,
        ):
            workspace.actions.do("scan.done")
    workspace.remember("scan done")
    tooltip("It is cut out, stands on the stage, and can be possessed")
    if imgui.button(labelled(tr("Cancel"), "Cancel"), _FULL_WIDTH):
        workspace.actions.do("scan.cancel")
    workspace.remember("scan cancel")
    imgui.end_disabled()


def _draw_progress(status: ScanMessage) -> None:
    """Draws the progress of a scan in a box of fixed height, so that changing text moves no button."""
    imgui.push_text_wrap_pos(0.0)
    places = tr(", in {0} places", status.places) if status.places > 1 else ""
    imgui.text_unformatted(tr("{0:.1f} m round it, {1} pictures{2}", status.way, status.fused, places))
    imgui.pop_text_wrap_pos()
    fraction = 1.0 - min(max(status.missing, 0.0), 1.0)
    with push_colours((*GOOD[:3], 0.9), imgui.Col_.plot_histogram):
        imgui.progress_bar(fraction, ImVec2(-1, 10), "")
    tooltip(tr("{0:.0f} of 100 parts of the surface in the middle were seen", 100 * fraction))
    arrow = "" if status.thing == "person" else tr(" The arrow leads to where most is missing.")
    draw_note(tr("Yellow lines: seen too little yet.{0}", arrow))
    if status.note:
        draw_note(status.note)
    if status.mend:
        draw_note(status.mend)


def _draw_kept_part(workspace: Workspace, scan: ScanSession) -> None:
    """Draws the choice of the scanned parts that the character keeps."""
    draw_heading("What is kept")
    for kept, label in _KEPT_PART_LABELS.items():
        if imgui.radio_button(f"{tr(label)}###keep {kept}", scan.kept_part == kept):
            scan.keep(kept)
        workspace.remember(f"scan keep {kept}")
    if scan.kept_part == "box":
        draw_note(
            "Drag the dots to move the sides of the box. The floor is left out unless the box goes below it."
        )
        if imgui.button(labelled(tr("Fit to the object"), "Fit to the object"), _FULL_WIDTH):
            scan.fit_box()
        workspace.remember("scan fit box")


def draw_scan_overlay(workspace: Workspace, area: Area) -> None:
    """Draws the camera, the arrow and the instructions over the view."""
    scan = workspace.scan
    if not scan.active:
        return
    draw_list = imgui.get_background_draw_list()
    draw_list.push_clip_rect(ImVec2(area.x, area.y), ImVec2(area.x + area.width, area.y + area.height))
    box = scan.box.marks(workspace.editor.lens) if scan.boxed else ()
    for mark in (*make_scan_marks(scan.message, workspace.editor.lens), *box):
        draw_mark(draw_list, area, mark)
    advice = choose_advice(scan.message)
    if advice.text:
        _draw_instruction(draw_list, area, tr(advice.text), _MOOD_COLOURS[advice.mood])
    draw_list.pop_clip_rect()


def _draw_instruction(draw_list: imgui.ImDrawList, area: Area, text: str, tint: Colour) -> None:
    """Draws one line of large text, centred at the top."""
    grown = imgui.calc_text_size(text).x / imgui.get_font_size()
    size = min(_ADVICE_TEXT_SIZE, (area.width - 120.0) / max(grown, 1e-3))
    width = grown * size
    x, y = area.x + (area.width - width) / 2, area.y + ADVICE_BOTTOM - _ADVICE_TEXT_SIZE - 12
    low, high = ImVec2(x - 48, y - 12), ImVec2(x + width + 24, y + size + 12)
    draw_list.add_rect_filled(low, high, pack_colour((*GLASS[:3], 0.85)), 12.0)
    draw_list.add_circle_filled(ImVec2(x - 24, y + size / 2), 9.0, pack_colour(tint))
    draw_list.add_text(imgui.get_font(), size, ImVec2(x, y), pack_colour(INK), text)
