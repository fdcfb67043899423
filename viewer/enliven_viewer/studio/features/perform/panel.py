"""The panel of the Perform workspace: the stage, its performers and characters, and recording."""

from __future__ import annotations

from contextlib import nullcontext
from functools import partial

from imgui_bundle import ImVec2, imgui

from enliven_viewer.language import labelled, tr
from enliven_viewer.live.hud import describe_delay, format_time
from enliven_viewer.live.live_stage import LiveStage
from enliven_viewer.live.possession_choice import PART_CHOICES
from enliven_viewer.studio.app.app import App
from enliven_viewer.studio.app.fields import draw_tooltip
from enliven_viewer.studio.app.panel_layout import Area
from enliven_viewer.studio.app.style import (
    draw_heading,
    draw_note,
    open_list_box,
    open_panel,
    pack_colour,
    push_colours,
    push_fill,
    use_small_text,
)
from enliven_viewer.studio.features.perform.cameras_panel import draw_cameras, draw_edge_list, shorten_text
from enliven_viewer.studio.features.perform.recording import StageRecording
from enliven_viewer.studio.features.perform.session import PerformSession
from enliven_viewer.studio.features.perform.voice_panel import draw_physics, draw_voice
from enliven_viewer.theme import ACCENT, BAD, GOOD, QUIET, WAIT, Colour

_FULL_WIDTH = ImVec2(-1, 0)
_PRIMARY_HEIGHT = 40.0
"""Height in pixels of the two main buttons: easy to hit."""
_STATUS_HEIGHT = 66.0
"""Height in pixels of the stage's status box. It fits three lines, more lines scroll."""
_TALL_STATUS_HEIGHT = 90.0
"""Height in pixels of the status box in a tall panel. It fits a message with advice."""
_MIN_TALL_PANEL_HEIGHT = 520.0
"""Minimum height in pixels of a tall panel."""
_DEFAULT_STILLNESS_S = 2.0
"""Default duration of stillness that ends a recording, in seconds. A dramatic pause is shorter."""
_LOCAL_ADDRESS = "127.0.0.1"
_CHARACTERS_HEIGHT = 98.0
"""Height in pixels of the list of characters: four lines. More lines scroll."""
_WIDGET_PREFIXES = ("waits ", "stands ", "remove ")
"""Beginnings of the names of widgets in the list of characters."""
_REMOVE_WIDTH = 58.0
"""Width in pixels of the Remove button at the right of a character on the stage."""


def draw_perform(app: App, area: Area) -> None:
    """Draws the right panel. The two main buttons stay at its top, and the rest scrolls."""
    perform = app.state(PerformSession)
    with open_panel("perform", area):
        live = perform.live
        if live is None:
            _draw_stage_options(app, perform, area)
            return
        _draw_main_buttons(app, perform)
        imgui.begin_child("##rest")
        _draw_stage_state(app, perform, live, area)
        # Also draw these in the frame in which the user leaves the stage.
        _draw_performers(app, perform, live)
        _draw_characters(app, perform)
        for draw_section in app.perform_sections:
            draw_section()
        if perform.client is not None:
            draw_physics(app, perform)
        _draw_recording_options(app, perform.recording)
        if perform.client is not None:
            _draw_other_cameras(app, perform)
        imgui.end_child()


def _draw_main_buttons(app: App, perform: PerformSession) -> None:
    """Draws the two main buttons of a performance. They are always at the same position."""
    size = ImVec2(
        (imgui.get_content_region_avail().x - imgui.get_style().item_spacing.x) / 2, _PRIMARY_HEIGHT
    )
    waits = perform.possession_requests.is_waiting
    with push_fill(WAIT if waits else ACCENT):
        if imgui.button(labelled(tr("Cancel") if waits else tr("Possess"), "Possess"), size):
            app.actions.do("perform.possess_alone")
    app.remember("possess")
    draw_tooltip(
        perform.possession_requests.words
        if waits
        else tr("Possess the chosen character as its only performer  (P)")
    )
    imgui.same_line()
    _draw_record_button(app, perform.recording, size)
    if perform.client is not None:
        draw_voice(app, perform)
    imgui.separator()


def _draw_record_button(app: App, recording: StageRecording, size: ImVec2) -> None:
    """Draws the button that starts or ends a recording. A click runs the action that was on the label when
    the mouse button was pressed.
    """
    if recording.phase == "recording":
        label, drawn = tr("Stop   {0}", format_time(recording.seconds)), push_fill(BAD)
    elif recording.phase == "counting":
        label, drawn = tr("Cancel   {0}", recording.beat), push_fill(WAIT)
    else:
        label, drawn = "\uf111  " + tr("Record"), nullcontext()
    with drawn:
        is_pressed = imgui.button(f"{label}###record", size)
    if imgui.is_item_activated():
        recording.phase_when_pressed = recording.phase
    if is_pressed and (recording.phase_when_pressed == "idle") == (recording.phase == "idle"):
        recording.toggle()
    app.remember("record")
    draw_tooltip("Records your movements on the timeline while everything else plays  (Ctrl+R)")


def describe_stage(perform: PerformSession) -> tuple[str, Colour]:
    """Returns the state of the connection as text, and the text's colour."""
    live = perform.live
    if live is None:
        return tr("No stage is connected"), QUIET
    edge = live.document.edge
    if live.take:
        return tr("Playing {0}", live.take), GOOD
    if not edge.connected:
        if live.is_local and not len(live.document.timeline):
            return live.preparation_text, WAIT
        silence_text = tr(
            "The stage at {0} sends nothing. The studio keeps trying to reconnect.",
            _shorten_address(edge.address),
        )
        search_text = tr("Looking for a stage at {0}", _shorten_address(edge.address))
        return (silence_text, BAD) if len(live.document.timeline) else (search_text, WAIT)
    if edge.phase == "ended":
        return tr("The camera or recording has ended"), WAIT
    if edge.signal != "live":
        signal_texts = {
            "slow": tr("Connected, but few pictures arrive"),
            "damaged": tr("Connected, but pictures are damaged"),
        }
        return signal_texts.get(edge.signal, tr("Connected, but no picture arrives")), WAIT
    delay_text = edge.sensor_to_pose_ms
    delay_text = describe_delay(None if delay_text is None else delay_text + (edge.pose_to_screen_ms or 0.0))
    return tr("Connected, {0}", delay_text) if delay_text else tr("Connected"), GOOD


def _shorten_address(address: str) -> str:
    return address.removeprefix("tcp://") or tr("the address")


def _draw_stage_options(app: App, perform: PerformSession, area: Area) -> None:
    """Draws the options for connecting to a stage. No widget moves when cameras are found."""
    draw_heading("Stage")
    _draw_state_line(perform)
    draw_cameras(app, area)
    perform.voice.wanted_state = imgui.checkbox(
        labelled(tr("Voice: also open the microphone"), "Voice: also open the microphone"),
        perform.voice.wanted_state,
    )[1]
    app.remember("voice wanted")
    draw_tooltip(
        "You can then speak commands; the sound stays on this computer. The panel lists the commands"
    )
    _draw_remote_cameras(app, perform)
    _draw_camera_replacements(app, perform)


def _draw_remote_cameras(app: App, perform: PerformSession) -> None:
    """Draws the edges on the network, a field for an address, and the addresses of earlier connections."""
    draw_heading("A camera on another computer")
    draw_edge_list(app)
    draw_note("Address of the computer with the camera. Or let a recorded person perform here.")
    imgui.set_next_item_width(-1)
    entered, app.state(PerformSession).address = imgui.input_text_with_hint(
        "##address", _LOCAL_ADDRESS, perform.address, imgui.InputTextFlags_.enter_returns_true
    )
    app.remember("address")
    is_connect_pressed = imgui.button(labelled(tr("Connect"), "Connect"), _FULL_WIDTH) or entered
    if is_connect_pressed and app.run_and_report(lambda: perform.connect(perform.address or _LOCAL_ADDRESS)):
        perform.address = ""  # Clear the field, so that the address of another camera can be typed.
    app.remember("connect")
    for address in perform.known_addresses:
        if imgui.selectable(f"{address}###known {address}", False)[0]:
            app.run_and_report(partial(perform.connect, address))
        app.remember(f"known {address}")


def _draw_camera_replacements(app: App, perform: PerformSession) -> None:
    """Draws the sources of performers that need no depth camera: recordings, a webcam, a simulation."""
    draw_heading("No camera here?")
    if imgui.button(labelled(tr("A recorded person"), "A recorded person"), _FULL_WIDTH):
        app.run_and_report(lambda: perform.connect_local("--loop"))
    app.remember("recorded person")
    draw_tooltip(
        "Plays the recording that comes with enliven in a loop, as if a person stood in front of the camera"
    )
    if imgui.button(labelled(tr("Your own recording..."), "Your own recording..."), _FULL_WIDTH):
        app.open_dialogue("perform")
    app.remember("recording of yours")
    draw_tooltip("Plays your camera recording or motion capture (.bvh) in a loop")
    if imgui.button(labelled(tr("A webcam"), "A webcam"), _FULL_WIDTH):
        app.run_and_report(lambda: perform.connect_local("--sensor", "webcam"))
    app.remember("webcam")
    draw_tooltip("Uses a normal camera instead of a depth camera. Experimental: MediaPipe finds the bodies")
    if imgui.button(labelled(tr("A simulated person"), "A simulated person"), _FULL_WIDTH):
        app.run_and_report(lambda: perform.connect_local("--sensor", "synthetic"))
    app.remember("made-up person")
    draw_tooltip("Simulates a figure that waves and walks, for testing")


def _draw_stage_state(app: App, perform: PerformSession, live: LiveStage, area: Area) -> None:
    """Draws the state and the problems of the stage.

    The box has a fixed height, so that nothing below it moves.
    """
    top = imgui.get_cursor_pos_y()
    draw_heading("Stage")
    below = imgui.get_cursor_pos()
    imgui.set_cursor_pos(ImVec2(imgui.get_content_region_avail().x - 44, top))
    with use_small_text():
        if imgui.small_button(labelled(tr("Leave"), "Leave")):
            perform.disconnect()
    app.remember("leave")
    draw_tooltip("Disconnects from the stage. Recordings are kept")
    imgui.set_cursor_pos(below)
    roomy = area.height > _MIN_TALL_PANEL_HEIGHT
    imgui.begin_child(
        "##state", ImVec2(0, _TALL_STATUS_HEIGHT if roomy else _STATUS_HEIGHT), imgui.ChildFlags_.frame_style
    )
    _draw_state_line(perform)
    edge = live.document.edge
    with use_small_text():
        if perform.connected and edge.message:
            with push_colours(WAIT, imgui.Col_.text):
                _draw_wrapped_text(edge.message)
        for state in edge.health[:2]:
            with push_colours(WAIT, imgui.Col_.text):
                _draw_wrapped_text(state.what)
            draw_note(state.remedy)
    imgui.end_child()
    app.remember("stage state")


def _draw_state_line(perform: PerformSession) -> None:
    """Draws the state of the stage with a coloured dot before it."""
    state_text, colour = describe_stage(perform)
    position, draw_list = imgui.get_cursor_screen_pos(), imgui.get_window_draw_list()
    draw_list.add_circle_filled(ImVec2(position.x + 5, position.y + 9), 4.5, pack_colour(colour))
    imgui.set_cursor_pos_x(imgui.get_cursor_pos_x() + 18)
    _draw_wrapped_text(state_text)


def _draw_wrapped_text(text: str) -> None:
    imgui.push_text_wrap_pos(0.0)
    imgui.text_unformatted(text)
    imgui.pop_text_wrap_pos()


def _draw_other_cameras(app: App, perform: PerformSession) -> None:
    """Draws the secondary edges, and a field to add one, below the more common options."""
    draw_heading("Other cameras")
    for number, guest in enumerate(list(perform.secondary_edges)):
        state = tr("connected") if guest.connected else tr("silent")
        imgui.text_unformatted(f"{guest.name}: {state}")
        if imgui.small_button(labelled(tr("Make main"), f"lead {number}")):
            perform.make_primary(guest)
        app.remember(f"lead {number}")
        draw_tooltip("Sends new characters and commands to this stage from now on")
        imgui.same_line()
        if imgui.small_button(labelled(tr("Leave"), f"leave {number}")):
            perform.remove_secondary(guest)
        app.remember(f"part {number}")
    imgui.set_next_item_width(-1)
    entered, perform.address = imgui.input_text_with_hint(
        "##beside", tr("address of another camera"), perform.address, imgui.InputTextFlags_.enter_returns_true
    )
    app.remember("beside address")
    if entered and perform.address and app.run_and_report(lambda: perform.add_secondary(perform.address)):
        perform.address = ""


def _draw_recording_options(app: App, recording: StageRecording) -> None:
    """Draws the recording options. The record button is at the top of the panel."""
    draw_heading("Record")
    last = recording.last_recording
    imgui.begin_disabled(recording.phase != "idle" or not last)
    if imgui.button(
        labelled(tr("Record again, and keep {0}", last or tr("the last take")), "again beside"), _FULL_WIDTH
    ):
        recording.record_again(keeps_last=True)
    app.remember("again beside")
    imgui.end_disabled()
    draw_tooltip("Keeps both takes. Choose in their lane on the timeline which take plays")
    recording.count_in = imgui.checkbox(
        labelled(tr("Count in: three, two, one"), "Count in: three, two, one"), recording.count_in
    )[1]
    app.remember("count in")
    recording.replaces = imgui.checkbox(
        labelled(tr("Replace the old motion"), "Replace the old motion"), recording.replaces
    )[1]
    draw_tooltip(
        "On: your motion replaces the old motion of the parts that you move. Off: your motion is added"
    )
    app.remember("replaces")
    _draw_end_conditions(app, recording)


def _draw_end_conditions(app: App, recording: StageRecording) -> None:
    """Draws the conditions that end a recording: stillness, or the end of the marked span."""
    held, still = recording.hold_still, bool(recording.hold_still)
    changed, still = imgui.checkbox(
        labelled(tr("Stop when everyone holds still"), "Stop when everyone holds still"), still
    )
    app.remember("hold still")
    draw_tooltip("Ends the recording when all performers hold still, and cuts off the still part")
    if changed:
        recording.hold_still = _DEFAULT_STILLNESS_S if still else 0.0
    if still:
        imgui.set_next_item_width(-1)
        recording.hold_still = imgui.slider_float(
            "##still", held or _DEFAULT_STILLNESS_S, 0.5, 5.0, tr("for %.1f s")
        )[1]
        app.remember("still for")
    if recording.span is None:
        draw_note("Press I and O to mark where recordings begin and end.")
        return
    first, last = recording.span
    imgui.text_unformatted(tr("From {0} to {1}", format_time(first), format_time(last)))
    imgui.same_line(imgui.get_content_region_avail().x - 40)
    if imgui.small_button(labelled(tr("Clear"), "span")):
        recording.span = None
    app.remember("clear span")
    recording.loops = imgui.checkbox(labelled(tr("Record in a loop"), "Record in a loop"), recording.loops)[1]
    app.remember("loops")
    draw_tooltip(
        "Records the marked time again and again until you stop. All takes are kept, and the last take plays"
    )


def _draw_characters(app: App, perform: PerformSession) -> None:
    """Draws all characters in a scrolling list of fixed height, the project's characters first. A character's
    line stays in place when the character enters or leaves the stage, and when other edges add characters.
    """
    draw_heading("Characters")
    editor = app.editor
    project_names = list(editor.project.characters)
    with open_list_box("characters", _CHARACTERS_HEIGHT) as available_width:
        for name in project_names:
            _draw_character(app, perform, name, available_width)
        for name in perform.stage_ids:
            if name not in editor.project.characters:
                _draw_character(app, perform, name, available_width)
        if not project_names and not perform.stage_ids:
            draw_note("No characters yet. Open a model or sketch a shape, and put it on the stage.")
    app.remember("characters")
    _scroll_to_list(app)
    chosen = editor.selection.character
    state = perform.staged.sender.states.get(chosen or "", "")
    can_put = chosen in project_names and chosen not in perform.stage_ids and not state.startswith("being")
    imgui.begin_disabled(not can_put)
    label = tr("Put {0} on the stage", chosen) if can_put else tr("Put the character on the stage")
    if imgui.button(
        labelled(shorten_text(label, imgui.get_content_region_avail().x - 16), "put"), _FULL_WIDTH
    ):
        perform.staged.put_selected()
    imgui.end_disabled()
    app.remember("put")
    draw_tooltip("A performer can then possess the character. It follows every edit  (Ctrl+Enter)")


def _scroll_to_list(app: App) -> None:
    """Scrolls the panel to the list of characters if the tour or a script requests one of its lines.
    Otherwise only the list itself would scroll.
    """
    drawn = app.drawn
    if drawn.is_user_scrolling or not any(name.startswith(_WIDGET_PREFIXES) for name in drawn.targets):
        return
    clip = imgui.get_window_draw_list()
    top, bottom = clip.get_clip_rect_min().y, clip.get_clip_rect_max().y
    if imgui.get_item_rect_min().y < top or imgui.get_item_rect_max().y > bottom:
        imgui.set_scroll_here_y(0.5)


def _draw_character(app: App, perform: PerformSession, name: str, available_width: float) -> None:
    """Draws one character's line: its name, its state, and the button that removes it from the stage.

    The state is the performer in control, "free", or the reason why the character is not on the stage.
    """
    standing = name in perform.stage_ids
    is_in_project, flags = name in app.editor.project.characters, imgui.SelectableFlags_.allow_overlap
    state = perform.staged.sender.states.get(name, "")
    if standing:
        state_text = (
            tr("in use") if any(holder.character == name for holder in perform.holders) else tr("free")
        )
    else:
        state_text = tr(state) if state else tr("not on the stage")
    chosen = perform.target == name if standing else app.editor.selection.character == name
    can_remove = standing and perform.live is not None and not perform.live.take
    label = shorten_text(f"{name}  ·  {state_text}", available_width - (_REMOVE_WIDTH if can_remove else 0.0))
    if imgui.selectable(f"{label}###character {name}", chosen, flags, ImVec2(available_width, 0))[0]:
        perform.stage_selection = name if standing else perform.stage_selection
        app.editor.select_only(name if is_in_project else None)
    app.remember(f"{'stands' if standing else 'waits'} {name}")
    draw_tooltip(state_text if state.startswith("refused") else "")
    if can_remove:
        imgui.same_line(available_width - _REMOVE_WIDTH)
        if imgui.small_button(labelled(tr("Remove"), f"remove {name}")):
            perform.staged.remove(name)
        app.remember(f"remove {name}")


def _draw_performers(app: App, perform: PerformSession, live: LiveStage) -> None:
    """Draws the choice of performer and body parts, and the other ways to control a character."""
    draw_heading("Performer and body parts")
    present, choice = perform.performers, live.possession
    numbers = {live.numbers.number_of(body): body for body in present}
    default_label = tr("Any free performer") if present else tr("First person in view")
    names = [default_label, *(tr("Performer {0}", number) for number in sorted(numbers))]
    bodies = [numbers[number] for number in sorted(numbers)]
    index = 1 + bodies.index(choice.body) if choice.body in bodies else 0
    imgui.set_next_item_width(-1)
    changed, index = imgui.combo("##performer", index, names)
    app.remember("performer")
    if changed:
        choice.body = bodies[index - 1] if index else None
        live.possess("preview")
    imgui.set_next_item_width(-1)
    changed, number = imgui.combo(
        "##parts", PART_CHOICES.index(choice.parts), list(map(_label_part, PART_CHOICES))
    )
    app.remember("parts")
    draw_tooltip("Body parts that will control the character. The stage shows what they would move  (1 to 9)")
    if changed:
        live.choose_parts(number)
    third = ImVec2((imgui.get_content_region_avail().x - 2 * imgui.get_style().item_spacing.x) / 3, 0)
    if imgui.button(labelled(tr("Join"), "Join"), third):
        perform.possession_requests.press("join")
    app.remember("join")
    draw_tooltip("Possess the character together with its current performers  (J)")
    imgui.same_line()
    if imgui.button(labelled(tr("Hold more"), "Hold more"), third):
        perform.possession_requests.press("extend")
    app.remember("extend")
    draw_tooltip("Also controls the character with these body parts  (E)")
    imgui.same_line()
    if imgui.button(labelled(tr("Release"), "Release"), third):
        live.release()
    app.remember("release")
    draw_tooltip("Releases the character  (R)")
    if imgui.checkbox(
        labelled(tr("Lock to the current performers"), "Lock to the current performers"), choice.locked
    )[0]:
        live.toggle_lock()
    app.remember("lock")
    draw_tooltip("Other people cannot become performers  (K)")


def _label_part(name: str) -> str:
    label = tr("the whole body") if name == "all" else tr(name)
    return label[:1].upper() + label[1:]
