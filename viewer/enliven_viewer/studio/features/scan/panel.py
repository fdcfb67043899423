"""The panel of a scan: the options before it, its progress, and the buttons that end it."""

from __future__ import annotations

from imgui_bundle import ImVec2, imgui

from enliven.wire import ScanMessage, ScanMode
from enliven_viewer.language import labelled, later, tr
from enliven_viewer.studio.app.app import App
from enliven_viewer.studio.app.fields import draw_tooltip
from enliven_viewer.studio.app.panel_layout import Area
from enliven_viewer.studio.app.style import draw_heading, draw_note, open_panel, push_colours
from enliven_viewer.studio.features.scan.session import KeptPart, ScanSession, ScanSize
from enliven_viewer.theme import ACCENT, GOOD, WAIT

_FULL_WIDTH = ImVec2(-1, 0)
_TALL_BUTTON_SIZE = ImVec2(-1, 38)
_SIZE_LABELS: dict[ScanSize, str] = {
    "small": later("Something small: a cup, a shoe"),
    "thing": later("A chair, a lamp"),
    "room": later("A room, or a large object"),
}
_MODE_LABELS: dict[ScanMode, tuple[str, str]] = {
    ScanMode.AROUND: (
        later("Walk round with the camera"),
        later("Walk round the object once, 1.5 m away. The object stays in its place"),
    ),
    ScanMode.MOVED: (
        later("Walk round twice: upright, lying"),
        later(
            "Go round the object once. Lay it on its back or side, take your hands off, and go round again"
        ),
    ),
    ScanMode.TURNED: (
        later("The object turns, the room is in view"),
        later("Let the object stand for a second, then turn it slowly on a turntable"),
    ),
    ScanMode.NEAR: (
        later("The camera stands still, you turn the object"),
        later(
            "Turn the object on a turntable or in your hands. The wall must be more than 1.5 m from the "
            "camera"
        ),
    ),
    ScanMode.PERSON: (
        later("A person turns on the spot"),
        later(
            "Stand 1 to 3 m away with your whole body in view and your arms off your sides. Turn once in "
            "5 s or more"
        ),
    ),
}
_KEPT_PART_LABELS: dict[KeptPart, str] = {
    "thing": later("Only the object on the floor"),
    "box": later("Only the inside of the box"),
    "all": later("Everything that was scanned"),
}
_REQUIREMENTS_HEIGHT = 54.0
"""Height in pixels of the text about the requirements of a scan: three lines."""
_BUTTONS_HEIGHT_BEFORE = 58.0
"""Height in pixels of the two buttons at the bottom before a scan."""
_BUTTONS_HEIGHT_DURING = 102.0
"""Height in pixels of the three buttons at the bottom during a scan, one of them tall."""
_PROGRESS_HEIGHT = 76.0
"""Height in pixels of the box with a scan's progress: a line, the bar, and a sentence. More text scrolls."""
_TALL_PROGRESS_HEIGHT = 140.0
"""Height in pixels of the same box in a tall panel, which also has space for the notes of the scan."""
_MIN_TALL_PANEL_HEIGHT = 520.0
"""Minimum height in pixels of a tall panel."""


def draw_scan(app: App, scan: ScanSession, area: Area) -> None:
    """Draws the panel at the right. The buttons that end a scan stay at its bottom, and the rest scrolls.

    The button that starts a scan is at the top. During a scan this position contains no button, so that a
    double click cannot stop the scan.
    """
    with open_panel("scan", area):
        imgui.begin_child(
            "##rest", ImVec2(0, -(_BUTTONS_HEIGHT_DURING if scan.active else _BUTTONS_HEIGHT_BEFORE))
        )
        if scan.active:
            _draw_running_scan(
                app,
                scan,
                _TALL_PROGRESS_HEIGHT if area.height > _MIN_TALL_PANEL_HEIGHT else _PROGRESS_HEIGHT,
            )
        else:
            _draw_start_options(app, scan)
        imgui.end_child()
        if scan.active:
            _draw_end(app, scan)
        else:
            _draw_continue_button(app, scan)
        if imgui.button(labelled(tr("Back to the stage"), "Back to the stage"), _FULL_WIDTH):
            scan.is_shown = False
        app.remember("scan back")


def draw_open_button(app: App) -> None:
    """Draws the button of the Perform panel that opens this panel."""
    if imgui.button(labelled("\uf030  " + tr("Scan an object..."), "Scan an object..."), _FULL_WIDTH):
        app.actions.do("scan.open")
    app.remember("scan")
    draw_tooltip("Scans a real object as a character: carry the camera round the object")


def _draw_start_options(app: App, scan: ScanSession) -> None:
    """Draws the options before a scan."""
    draw_heading("Scan")
    lacking = tr(scan.describe_missing_stage())
    imgui.begin_disabled(bool(lacking))
    with push_colours((*ACCENT[:3], 0.4), imgui.Col_.button):
        if imgui.button(labelled("\uf030  " + tr("Start"), "Start"), _TALL_BUTTON_SIZE):
            app.actions.do("scan.start")
    app.remember("scan start")
    imgui.end_disabled()
    imgui.begin_child("##before", ImVec2(0, _REQUIREMENTS_HEIGHT))
    if lacking:
        with push_colours(WAIT, imgui.Col_.text):
            imgui.push_text_wrap_pos(0.0)
            imgui.text_unformatted(lacking.partition(". ")[0])
            imgui.pop_text_wrap_pos()
        draw_note(lacking.partition(". ")[2])
    else:
        draw_note("Carry the camera once round an object, 1.5 m away. The object becomes a character.")
    imgui.end_child()
    draw_heading("What is it?")
    imgui.set_next_item_width(-1)
    opened = imgui.begin_combo("##scan size", tr(_SIZE_LABELS[scan.size]))
    app.remember("scan size")
    if opened:
        for size, label in _SIZE_LABELS.items():
            if imgui.selectable(f"{tr(label)}###size {size}", scan.size == size)[0]:
                scan.size = size
            app.remember(f"scan {size}")
        imgui.end_combo()
    draw_heading("How?")
    for mode, (label, tip) in _MODE_LABELS.items():
        if imgui.radio_button(f"{tr(label)}###way {mode}", scan.mode is mode):
            scan.mode = mode
        app.remember(f"scan {mode}")
        draw_tooltip(tip)
    draw_heading("Name of the character")
    imgui.set_next_item_width(-1)
    scan.name = imgui.input_text_with_hint("##scan name", "scan", scan.name)[1]
    app.remember("scan name")


def _draw_continue_button(app: App, scan: ScanSession) -> None:
    """Draws the button that continues the last scan."""
    imgui.begin_disabled(bool(scan.describe_missing_repeat()))
    label = tr("Add to {0}", scan.message.character or tr("the last scan"))
    if imgui.button(labelled(label, "again"), _FULL_WIDTH):
        app.actions.do("scan.again")
    imgui.end_disabled()
    app.remember("scan again")
    draw_tooltip("Continues the scan to fill gaps. Lay the object on its side, or scan it from below")


def _draw_running_scan(app: App, scan: ScanSession, height: float) -> None:
    """Draws the progress, in a box ``height`` pixels high, and the commands of a running scan."""
    status = scan.message
    draw_heading("Scan")
    imgui.begin_child("##progress", ImVec2(0, height), imgui.ChildFlags_.frame_style)
    _draw_progress(status)
    imgui.end_child()
    app.remember("scan progress")
    draw_heading("Controls")
    making = status.phase == "finishing"
    imgui.begin_disabled(making)
    label = tr("\uf04c  Pause") if status.phase == "scanning" else tr("\uf04b  Continue")
    half = ImVec2((imgui.get_content_region_avail().x - imgui.get_style().item_spacing.x) / 2, 0)
    if imgui.button(f"{label}###pause", half):
        app.actions.do("scan.pause")
    app.remember("scan pause")
    imgui.same_line()
    imgui.begin_disabled(status.undoable <= 0)
    if imgui.button(labelled("\uf0e2  " + tr("Undo"), "Undo"), half):
        app.actions.do("scan.undo")
    app.remember("scan undo")
    draw_tooltip(
        tr(
            "Removes the last {0:.0f} seconds, for example after a hand came into view",
            status.undoable,
        )
    )
    imgui.end_disabled()
    if status.thing != "person":
        _draw_kept_part(app, scan)
    imgui.end_disabled()


def _draw_end(app: App, scan: ScanSession) -> None:
    """Draws the buttons that end a scan: Done makes a character, Cancel discards the scan."""
    making = scan.message.phase == "finishing"
    imgui.begin_disabled(making)
    with push_colours((*GOOD[:3], 0.4), imgui.Col_.button):
        if imgui.button(
            labelled(tr("Making the character..."), "done")
            if making
            else labelled("\uf00c  " + tr("Done"), "done"),
            _TALL_BUTTON_SIZE,
        ):
            app.actions.do("scan.done")
    app.remember("scan done")
    draw_tooltip("Ends the scan, and puts the object on the stage as a character that you can possess")
    if imgui.button(labelled(tr("Cancel"), "Cancel"), _FULL_WIDTH):
        app.actions.do("scan.cancel")
    app.remember("scan cancel")
    imgui.end_disabled()


def _draw_progress(status: ScanMessage) -> None:
    """Draws the progress of a scan in a box of fixed height, so that changing text moves no button."""
    imgui.push_text_wrap_pos(0.0)
    places = tr(", object at {0} places", status.places) if status.places > 1 else ""
    imgui.text_unformatted(tr("Camera path: {0:.1f} m, {1} pictures{2}", status.way, status.fused, places))
    imgui.pop_text_wrap_pos()
    fraction = 1.0 - min(max(status.missing, 0.0), 1.0)
    with push_colours((*GOOD[:3], 0.9), imgui.Col_.plot_histogram):
        imgui.progress_bar(fraction, ImVec2(-1, 10), "")
    draw_tooltip(tr("{0:.0f} % of the surface in the middle is scanned", 100 * fraction))
    arrow = "" if status.thing == "person" else tr(" The arrow points to the largest gap.")
    draw_note(tr("Yellow lines: parts that are not scanned enough yet.{0}", arrow))
    if status.note:
        draw_note(status.note)
    if status.remedy:
        draw_note(status.remedy)


def _draw_kept_part(app: App, scan: ScanSession) -> None:
    """Draws the radio buttons that select which part of the scan becomes the character."""
    draw_heading("What to keep")
    for kept, label in _KEPT_PART_LABELS.items():
        if imgui.radio_button(f"{tr(label)}###keep {kept}", scan.kept_part == kept):
            scan.choose_kept_part(kept)
        app.remember(f"scan keep {kept}")
    if scan.kept_part == "box":
        draw_note(
            "Drag the dots to move the sides of the box. The floor is not kept unless the box reaches "
            "below it."
        )
        if imgui.button(labelled(tr("Fit to the object"), "Fit to the object"), _FULL_WIDTH):
            scan.fit_box()
        app.remember("scan fit box")
