"""Handles a press of the *Possess* button: executes it immediately or once it is possible, or refuses it with
advice.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Protocol

from enliven.wire import SCAN, SUPERSEDED, Answer, Mode, Refused, ScanMessage
from enliven_viewer.language import tr
from enliven_viewer.link.edge_client import EdgeClient
from enliven_viewer.link.edge_connection import NO_ANSWER_TEXT
from enliven_viewer.live.live_stage import LiveStage
from enliven_viewer.studio.editor.editor import Editor
from enliven_viewer.studio.features.perform.staged_characters import StagedCharacters

MAX_WAIT_S = 120.0
"""Maximum seconds that a press waits for a stage, a character or a performer. The first start compiles
kernels, and an artist who works alone walks from the keyboard to the camera.
"""
MIN_TIME_IN_VIEW_S = 0.8
"""Seconds for which a new performer must be in view before the possession. By then, the performer is
completely visible and still.
"""

_BUSY_DELAY_S = 0.3
"""If the edge has not answered after this number of seconds, the stage is reported as busy. Most answers take
one frame.
"""


class FollowedStage(Protocol):
    """The session to which a press applies. It follows a stage."""

    editor: Editor
    live: LiveStage | None
    staged: StagedCharacters
    stage_selection: str

    @property
    def connected(self) -> bool:
        """Returns True if messages arrive from an edge."""

    @property
    def client(self) -> EdgeClient | None:
        """Returns the client of the edge, or None if there is none."""

    @property
    def stage_ids(self) -> tuple[str, ...]:
        """Returns the ids of the characters on the stage."""

    @property
    def performers(self) -> tuple[int, ...]:
        """Returns the ids of the performers in view."""

    def describe_missing_edge(self) -> str:
        """Returns the reason why no edge can be used, or an empty text if one can be used."""


@dataclass
class _PendingPress:
    """A press that is neither executed nor refused yet.

    Attributes:
        mode: treatment of existing attachments: keep or release them.
        character: id of the selected character; empty to let the edge choose.
        until: time at which the press expires, as returned by time.monotonic().
        asked: whether a request to the edge is unanswered.
        since: monotonic time of the first request.
        of_scan: True if the press applies to the character of a running scan.
        had_to_wait: True if at some time no performer was in view.
        seen_since: monotonic time since which a performer is in view.
        is_accepted: True if the press was not refused immediately.
    """

    mode: Mode
    character: str
    until: float
    asked: bool = False
    since: float | None = None
    of_scan: bool = False
    had_to_wait: bool = False
    seen_since: float | None = None
    is_accepted: bool = False


class PossessionRequests:
    """Executes requests to possess a character once the stage, the character and a performer are available.

    Attributes:
        words: the condition for which a press waits, shown as large text; empty if no press waits.
    """

    def __init__(self, stage: FollowedStage) -> None:
        self._stage = stage
        self._press: _PendingPress | None = None
        self.words = ""

    @property
    def is_waiting(self) -> bool:
        """Returns True if a press is waiting. The next press cancels it."""
        return bool(self.words)

    def press(self, mode: Mode = "alone") -> None:
        """Possesses the selected character, or cancels a waiting press."""
        if self.is_waiting:
            self.forget()
            return
        live = self._stage.live
        if live is not None and live.take:
            self._cancel_with_reason(
                tr("A recording is playing, so no character can be possessed. Connect to a stage first")
            )
        elif live is not None and self._stage.client is None:
            live.possess(mode)
        elif live is not None:
            chosen = self._stage.editor.selection.character or self._stage.stage_selection
            self._press = _PendingPress(mode, chosen or "", time.monotonic() + MAX_WAIT_S)
            self.advance()

    def forget(self) -> None:
        """Cancels the waiting press."""
        self._press, self.words = None, ""

    def advance(self) -> None:
        """Executes a waiting press if its conditions are met. Call once per frame."""
        press = self._press
        if press is None:
            return
        if press.asked:
            self.words = self._describe_busy_stage(press)
            return
        lacking = self._find_refusal(press)
        if lacking:
            self._cancel_with_reason(lacking)
            return
        press.is_accepted = True
        self.words = self._describe_missing(press)
        if self.words and time.monotonic() > press.until:
            self._cancel_with_reason(tr("“Possess” has waited too long") + ". " + self.words)
        elif not self.words:
            self._send_request(press)

    def _find_refusal(self, press: _PendingPress) -> str:
        """Returns the reason why the press can never be executed, or an empty text if it may still be
        executed.
        """
        stage, live = self._stage, self._stage.live
        if live is None:
            return stage.describe_missing_edge()
        if not stage.connected:
            # An edge is silent for seconds while it prepares a character. A press from before stays valid
            # during this time.
            is_coming = press.is_accepted or (live.is_local and not len(live.document.timeline))
            return "" if is_coming else stage.describe_missing_edge()
        name, phase = press.character, self.scan_message.phase
        state = stage.staged.sender.states.get(name, "")
        if state.startswith("refused"):
            return tr("{0} cannot be put on the stage. {1}", name, state.removeprefix("refused: "))
        if phase in ("scanning", "paused"):
            return tr("The camera is scanning. Finish or cancel the scan first")
        if press.of_scan and phase in ("off", "failed"):
            return tr(
                "The scan could not be turned into a character. Scan again, or choose another character"
            )
        project_character = stage.editor.project.characters.get(name)
        if project_character is not None and name not in stage.stage_ids:
            return (
                ""
                if project_character.mesh is not None
                else tr("The chosen shape has no surface, so it cannot be possessed")
            )
        is_known = stage.client is not None and stage.client.edges[0].has_all_characters
        is_coming = bool(stage.staged.sender.states) or press.of_scan or phase == "finishing" or not is_known
        nothing = tr("The stage has no character. Choose a character, and put it on the stage")
        return "" if stage.stage_ids or is_coming else nothing

    def _describe_missing(self, press: _PendingPress) -> str:
        """Returns a text about the missing condition, or an empty text if all are met."""
        stage, live = self._stage, self._stage.live
        if live is None or stage.client is None:
            return ""
        if not stage.connected and len(live.document.timeline):
            return stage.describe_missing_edge()
        if not stage.connected or not (stage.stage_ids or stage.client.edges[0].has_all_characters):
            return live.preparation_text
        if self.scan_message.phase == "finishing":
            press.of_scan = True
            return tr("The scan is being turned into a character")
        if press.of_scan:
            press.character = self.scan_message.character
        if waiting := self._describe_missing_character(press):
            return waiting
        now = time.monotonic()
        if not stage.performers and live.playhead.live:
            press.seen_since, press.had_to_wait = None, True
            return tr("No one is in view: step in front of the camera")
        press.seen_since = press.seen_since or now
        if press.had_to_wait and now - press.seen_since < MIN_TIME_IN_VIEW_S:
            return tr("Stand still for a moment")
        return ""

    def _describe_missing_character(self, press: _PendingPress) -> str:
        """Puts the character on the stage if it is missing.

        Returns a text while the character is not there yet, otherwise an empty text.
        """
        stage, name = self._stage, press.character
        project_characters = stage.editor.project.characters
        if name in stage.stage_ids or (
            stage.stage_ids and name not in project_characters and not press.of_scan
        ):
            return ""
        if name in project_characters and name not in stage.staged.sender.states and stage.client is not None:
            stage.staged.sender.send(stage.client.stage, stage.editor.project, name)
        return (
            tr("{0} is being prepared for the stage", name)
            if name
            else tr("A character is being prepared for the stage")
        )

    def _describe_busy_stage(self, press: _PendingPress) -> str:
        """Returns a text if the edge has not answered for a while, otherwise an empty text."""
        lasts = press.since is not None and time.monotonic() - press.since > _BUSY_DELAY_S
        return tr("The stage is busy. Please wait a moment") if lasts else ""

    def _send_request(self, press: _PendingPress) -> None:
        """Sends the request to the edge."""
        stage = self._stage
        if stage.live is None or stage.client is None:
            return
        press.asked, press.since = True, press.since or time.monotonic()
        self.words = self._describe_busy_stage(press)
        character_id = press.character if press.character in stage.stage_ids else None
        order = stage.live.order_to_possess(press.mode, character_id)
        stage.client.ask(order, lambda answer: self._handle_answer(press, answer))

    def _handle_answer(self, press: _PendingPress, answer: Answer) -> None:
        """Handles the edge's answer. If the edge is busy, the request is sent again."""
        if press is not self._press:
            return
        if isinstance(answer, Refused) and answer.reason.endswith(NO_ANSWER_TEXT):
            press.asked = False
            if time.monotonic() > press.until:
                self._cancel_with_reason(
                    tr("The stage does not answer. Check that its camera program (enliven edge) is running")
                )
            return
        self.forget()
        if isinstance(answer, Refused) and answer.reason != SUPERSEDED:
            location, _, problem = answer.reason.partition(": ")
            self._cancel_with_reason(
                problem if location.startswith(("possessing", "stage")) else answer.reason
            )

    def _cancel_with_reason(self, reason: str) -> None:
        """Shows the reason and the advice, and cancels the press."""
        self.forget()
        problem, _, remedy = reason.partition(". ")
        self._stage.editor.toasts.show_message(problem[:1].upper() + problem[1:].removesuffix("."), remedy)

    @property
    def scan_message(self) -> ScanMessage:
        """Returns the state of the edge's scan."""
        client = self._stage.client
        return (None if client is None else client.latest(SCAN).get("")) or ScanMessage()
