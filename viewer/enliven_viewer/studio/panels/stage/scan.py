"""The panel of a scan, and the instructions over the view for the person that carries the camera."""

from __future__ import annotations

from imgui_bundle import ImVec2, imgui

from enliven.wire import ScanMessage
from enliven_viewer.language import labelled, later, tr
from enliven_viewer.studio.panel_layout import Area
from enliven_viewer.studio.panels.fields import tooltip
from enliven_viewer.studio.panels.style import heading, packed, panel, quiet, tinted
from enliven_viewer.studio.panels.viewport_overlay import draw_mark
from enliven_viewer.studio.scan import KeptPart, ScanMode, ScanSession, ScanSize, advice_of, scan_marks
from enliven_viewer.studio.workspace import Workspace
from enliven_viewer.theme import ACCENT, BAD, GLASS, GOOD, INK, WAIT, Colour

_FULL_WIDTH = ImVec2(-1, 0)
_TALL_BUTTON_SIZE = ImVec2(-1, 38)
_ADVICE_TEXT_SIZE = 34.0
"""Text size in pixels of the instructions: readable from three metres, with a camera in the hands."""
ADVICE = 72.0
"""Distance in pixels from the top of the view to the lower end of the instructions."""
_SIZE_LABELS: dict[ScanSize, str] = {
    "small": later("Something small: a cup, a shoe"),
    "thing": later("A chair, a lamp"),
    "room": later("A room, or a large thing"),
}
_MODE_LABELS: dict[ScanMode, tuple[str, str]] = {
    "round": (
        later("The camera goes round it"),
        later("Once, a metre and a half away; the object stays in its place"),
    ),
    "laid": (
        later("It is laid down otherwise, too"),
        later("Go round it once, lay it on its back or side, take your hands off, and go round again"),
    ),
    "spun": (
        later("It turns, the room is in view"),
        later("Let it stand for a second, then turn it on a turntable, slowly; it is followed"),
    ),
    "turned": (
        later("The camera stands still, it is turned"),
        later("On a turntable or in the hands; the wall well behind, 1.5 m away"),
    ),
    "person": (
        later("A person turns round"),
        later(
            "One to three metres away, whole in view, arms off the sides; once round in five seconds or more"
        ),
    ),
}
_KEPT_PART_LABELS: dict[KeptPart, str] = {
    "thing": later("What stands on the floor"),
    "box": later("What is in the box"),
    "all": later("All that was scanned"),
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
    with panel("scan", area):
        imgui.begin_child(
            "##rest", ImVec2(0, -(_BUTTONS_HEIGHT_DURING if scan.active else _BUTTONS_HEIGHT_BEFORE))
        )
        if scan.active:
            _under_way(
                workspace,
                scan,
                _TALL_PROGRESS_HEIGHT if area.height > _MIN_TALL_PANEL_HEIGHT else _PROGRESS_HEIGHT,
            )
        else:
            _before(workspace, scan)
        imgui.end_child()
        if scan.active:
            _draw_end(workspace, scan)
        else:
            _draw_again(workspace, scan)
        if imgui.button(labelled(tr("Back to the stage"), "Back to the stage"), _FULL_WIDTH):
            scan.shown = False
        workspace.remember("scan back")


def _before(workspace: Workspace, scan: ScanSession) -> None:
    """Draws the options before a scan."""
    heading("Scan")
    lacking = tr(scan.lacks_stage())
    imgui.begin_disabled(bool(lacking))
    with tinted((*ACCENT[:3], 0.4), imgui.Col_.button):
        if imgui.button(labelled("\uf030  " + tr("Start"), "Start"), _TALL_BUTTON_SIZE):
            workspace.actions.do("scan.start")
    workspace.remember("scan start")
    imgui.end_disabled()
    imgui.begin_child("##before", ImVec2(0, _REQUIREMENTS_HEIGHT))
    if lacking:
        with tinted(WAIT, imgui.Col_.text):
            imgui.push_text_wrap_pos(0.0)
            imgui.text_unformatted(lacking.partition(". ")[0])
            imgui.pop_text_wrap_pos()
        quiet(lacking.partition(". ")[2])
    else:
        quiet("Carry the camera round a thing once, a metre and a half away, and it becomes a character.")
    imgui.end_child()
    heading("What is it?")
    imgui.set_next_item_width(-1)
    opened = imgui.begin_combo("##scan size", tr(_SIZE_LABELS[scan.size]))
    workspace.remember("scan size")
    if opened:
        for size, words in _SIZE_LABELS.items():
            if imgui.selectable(f"{tr(words)}###size {size}", scan.size == size)[0]:
                scan.size = size
            workspace.remember(f"scan {size}")
        imgui.end_combo()
    heading("How?")
    for way, (words, more) in _MODE_LABELS.items():
        if imgui.radio_button(f"{tr(words)}###way {way}", scan.mode == way):
            scan.mode = way
        workspace.remember(f"scan {way}")
        tooltip(more)
    heading("Its name")
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


def _under_way(workspace: Workspace, scan: ScanSession, tall: float) -> None:
    """Draws the progress, in a box ``tall`` pixels high, and the commands of a running scan."""
    status = scan.message
    heading("Scan")
    imgui.begin_child("##progress", ImVec2(0, tall), imgui.ChildFlags_.frame_style)
    _progress(status)
    imgui.end_child()
    workspace.remember("scan progress")
    heading("Go on")
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
            "Takes the last {0:.0f} seconds back: a hand came into view, or the camera slipped",
            status.undoable,
        )
    )
    imgui.end_disabled()
    if status.thing != "person":
        _keeping(workspace, scan)
    imgui.end_disabled()


def _draw_end(workspace: Workspace, scan: ScanSession) -> None:
    """Draws the buttons that end a scan: Done makes a character, Cancel discards the scan."""
    making = scan.message.phase == "finishing"
    imgui.begin_disabled(making)
    with tinted((*GOOD[:3], 0.4), imgui.Col_.button):
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


def _progress(status: ScanMessage) -> None:
    """Draws the progress of a scan in a box of fixed height, so that changing text moves no button."""
    imgui.push_text_wrap_pos(0.0)
    places = tr(", in {0} places", status.places) if status.places > 1 else ""
    imgui.text_unformatted(tr("{0:.1f} m round it, {1} pictures{2}", status.way, status.fused, places))
    imgui.pop_text_wrap_pos()
    share = 1.0 - min(max(status.missing, 0.0), 1.0)
    with tinted((*GOOD[:3], 0.9), imgui.Col_.plot_histogram):
        imgui.progress_bar(share, ImVec2(-1, 10), "")
    tooltip(tr("{0:.0f} of 100 parts of the surface in the middle were seen", 100 * share))
    arrow = "" if status.thing == "person" else tr(" The arrow leads to where most is missing.")
    quiet(tr("Yellow lines: seen too little yet.{0}", arrow))
    if status.note:
        quiet(status.note)
    if status.mend:
        quiet(status.mend)


def _keeping(workspace: Workspace, scan: ScanSession) -> None:
    """Draws the choice of the scanned parts that the character keeps."""
    heading("What is kept")
    for kept, words in _KEPT_PART_LABELS.items():
        if imgui.radio_button(f"{tr(words)}###keep {kept}", scan.kept_part == kept):
            scan.keep(kept)
        workspace.remember(f"scan keep {kept}")
    if scan.kept_part == "box":
        quiet("Drag the dots to move the sides of the box. Without the floor, unless it reaches under it.")
        if imgui.button(labelled(tr("Round the middle"), "Round the middle"), _FULL_WIDTH):
            scan.fit_box()
        workspace.remember("scan fit box")


def draw_scan_over(workspace: Workspace, area: Area) -> None:
    """Draws the camera, the arrow and the instructions over the view."""
    scan = workspace.scan
    if not scan.active:
        return
    draw = imgui.get_background_draw_list()
    draw.push_clip_rect(ImVec2(area.x, area.y), ImVec2(area.x + area.width, area.y + area.height))
    box = scan.box.marks(workspace.editor.lens) if scan.boxed else ()
    for mark in (*scan_marks(scan.message, workspace.editor.lens), *box):
        draw_mark(draw, area, mark)
    advice = advice_of(scan.message)
    if advice.text:
        _words(draw, area, tr(advice.text), _MOOD_COLOURS[advice.mood])
    draw.pop_clip_rect()


def _words(draw: imgui.ImDrawList, area: Area, text: str, tint: Colour) -> None:
    """Draws one line of large text, centred at the top."""
    grown = imgui.calc_text_size(text).x / imgui.get_font_size()
    size = min(_ADVICE_TEXT_SIZE, (area.width - 120.0) / max(grown, 1e-3))
    wide = grown * size
    x, y = area.x + (area.width - wide) / 2, area.y + ADVICE - _ADVICE_TEXT_SIZE - 12
    low, high = ImVec2(x - 48, y - 12), ImVec2(x + wide + 24, y + size + 12)
    draw.add_rect_filled(low, high, packed((*GLASS[:3], 0.85)), 12.0)
    draw.add_circle_filled(ImVec2(x - 24, y + size / 2), 9.0, packed(tint))
    draw.add_text(imgui.get_font(), size, ImVec2(x, y), packed(INK), text)
