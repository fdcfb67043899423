"""Draws the microphone switch, its state, and the recognised words in a fixed area of the Perform panel."""

from __future__ import annotations

from imgui_bundle import ImVec2, imgui

from enliven_viewer.language import Texts, tr
from enliven_viewer.studio.app.app import App
from enliven_viewer.studio.app.fields import draw_tooltip
from enliven_viewer.studio.app.style import draw_heading, draw_note, push_colours, use_small_text
from enliven_viewer.studio.features.perform.cameras_panel import shorten_text
from enliven_viewer.studio.features.perform.session import PerformSession
from enliven_viewer.studio.features.perform.stage_switches import LOOSE_LABELS
from enliven_viewer.theme import BAD, GOOD, INK, QUIET, WAIT

_MICROPHONE_ICON, _MUTED_ICON = "\uf130", "\uf131"
"""Font Awesome 4 icons of the open and of the closed microphone."""
_ROW_HEIGHT = 40.0
"""Fixed height of the row in pixels: two lines of small text."""
_SWITCH_SIZE = 36.0
"""Side length of the switch in pixels. It is easy to hit."""
_HELP_SIZE = 24.0
"""Side length in pixels of the button that lists the phrases."""
_PHYSICS_HEIGHT = 50.0
"""Height in pixels of the physics state: three lines of small text."""
_COMMAND_LABELS = Texts(
    {
        "possess": "possesses the character",
        "join": "possesses the character together with others",
        "extend": "adds body parts",
        "release": "releases the character",
        "next": "next match",
        "previous": "previous match",
        "follow": "lets the performer's pose choose the match again",
        "lock": "locks to the current performers",
        "unlock": "lets other people perform again",
        "scale": "scales the character with both hands",
        "parts": "chooses the body parts",
        "record": "starts a recording",
        "stop": "ends the recording",
        "again": "records the last take again",
    }
)
"""Displayed descriptions of the edge's commands."""
_DESCRIPTIONS_X = 210.0
"""Horizontal position in pixels of the descriptions in the list of phrases."""
_POPUP_ID = "phrases"
"""The name of the popup with the phrases."""


def draw_voice(app: App, perform: PerformSession) -> None:
    """Draws the microphone switch, the recognised words, and the list of phrases."""
    voice = perform.voice
    flags = imgui.WindowFlags_.no_scrollbar | imgui.WindowFlags_.no_scroll_with_mouse
    imgui.begin_child("##voice row", ImVec2(0, _ROW_HEIGHT), 0, flags)
    top = imgui.get_cursor_screen_pos()
    listening = voice.state is not None and voice.state.state == "listening"
    tint = GOOD if listening else BAD if voice.is_on and voice.state.state == "missing" else QUIET  # type: ignore[union-attr]
    imgui.begin_disabled(voice.state is None)
    with push_colours(tint, imgui.Col_.text):
        icon = _MICROPHONE_ICON if voice.is_on else _MUTED_ICON
        if imgui.button(f"{icon}###voice", ImVec2(_SWITCH_SIZE, _SWITCH_SIZE)):
            voice.toggle(perform.client)
    imgui.end_disabled()
    app.remember("voice")
    draw_tooltip("Close the microphone" if voice.is_on else "Voice: open the microphone of this stage")
    available_width = imgui.get_window_size().x - _SWITCH_SIZE - _HELP_SIZE - 22
    heard_text = voice.heard_words
    colour = (GOOD if voice.is_understood else WAIT) if heard_text else INK
    lines = ((heard_text or tr(voice.status), colour), (voice.advice, QUIET))
    with use_small_text():
        for number, (text, tint) in enumerate(lines):
            imgui.set_cursor_screen_pos(ImVec2(top.x + _SWITCH_SIZE + 8, top.y + 2 + 18 * number))
            with push_colours(tint, imgui.Col_.text):
                imgui.text_unformatted(shorten_text(text, available_width))
            draw_tooltip(text)
    app.remember("voice state")
    imgui.set_cursor_screen_pos(ImVec2(top.x + imgui.get_window_size().x - _HELP_SIZE, top.y + 6))
    if imgui.button("?##phrases", ImVec2(_HELP_SIZE, _HELP_SIZE)):
        imgui.open_popup(_POPUP_ID)
    app.remember("voice phrases")
    draw_tooltip("Lists the spoken commands")
    if imgui.begin_popup(_POPUP_ID):
        for phrase, action in voice.phrases:
            imgui.text_unformatted(phrase)
            imgui.same_line(_DESCRIPTIONS_X)
            with push_colours(QUIET, imgui.Col_.text):
                imgui.text_unformatted(describe_command(action))
        imgui.end_popup()
    imgui.end_child()


def describe_command(action: str) -> str:
    """Returns the displayed description of a command of the edge, such as "possess left arm"."""
    verb, _, parts = action.partition(" ")
    label = _COMMAND_LABELS.get(verb, verb)
    return f"{label}: {parts}" if parts else label


def draw_physics(app: App, perform: PerformSession) -> None:
    """Draws the selection of loose objects and their requirements, in a fixed area."""
    physics = perform.physics
    draw_heading("Physics")
    imgui.begin_disabled(physics.state is None)
    imgui.set_next_item_width(-1)
    changed, number = imgui.combo("##physics", physics.number, [tr(label) for label in LOOSE_LABELS])
    imgui.end_disabled()
    app.remember("physics")
    draw_tooltip("Loose objects on the stage that characters can knock over")
    if changed:
        physics.ask(perform.client, number)
    imgui.begin_child("##physics state", ImVec2(0, _PHYSICS_HEIGHT))
    if physics.has_problem:
        with use_small_text(), push_colours(WAIT, imgui.Col_.text):
            imgui.push_text_wrap_pos(0.0)
            imgui.text_unformatted(tr(physics.state_text))
            imgui.pop_text_wrap_pos()
    else:
        draw_note(physics.state_text)
    imgui.end_child()
    app.remember("physics state")
