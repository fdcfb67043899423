"""The project's characters on the stage of an edge: the user puts them there, and they follow every edit."""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial
from typing import Protocol

from enliven.document import Project, RigBase
from enliven.formats.project.one_character import texture_bytes
from enliven.wire import MAX_TEXTURE_BYTES, Answer, Done, Refused
from enliven_viewer.language import later, tr
from enliven_viewer.link.stage_link import StageLink
from enliven_viewer.studio.editor.editor import Editor

_SEND_DELAY_S = 0.25
"""An edited character is sent after this number of seconds without another edit, so that dragging a slider
sends it only once.
"""


class StageSender:
    """Keeps the characters on the stage equal to those of the project.

    Args:
        show_message: a function that shows a message and advice.

    Attributes:
        states: the displayed state of each character, by its id.
    """

    def __init__(self, show_message: Callable[[str, str], None]) -> None:
        self._show_message = show_message
        self.states: dict[str, str] = {}
        self._sent: dict[str, RigBase] = {}
        self._edited: dict[str, tuple[RigBase, float]] = {}

    def send(self, stage: StageLink, project: Project, name: str) -> None:
        """Sends a character. It is sent again automatically after edits."""
        character = project.character(name)
        is_resent = self.states.get(name) == "on the stage"
        self._sent[name], self.states[name] = character, "being sent"
        on_answer = partial(self._handle_answer, name, is_resent)
        stage.put(project, name, then=on_answer)

    def mark_sent(self, name: str, character: RigBase) -> None:
        """Records that a character made by the edge is on the stage in its current state."""
        self._sent[name], self.states[name] = character, "on the stage"

    def remove(self, stage: StageLink, name: str) -> None:
        """Removes a character from the stage."""
        self._sent.pop(name, None)
        self.states.pop(name, None)
        stage.remove(name, partial(self._handle_removal, name))

    def advance(self, stage: StageLink, project: Project) -> None:
        """Sends edited characters after a pause in the editing."""
        now = time.monotonic()
        for name, sent in list(self._sent.items()):
            character = project.characters.get(name)
            if character is not None and differs_in_motion_only(character, sent):
                self._sent[name] = character
                continue
            if character is None or character is sent or self.states[name].startswith("refused"):
                self._edited.pop(name, None)
                continue
            if self._edited.get(name, (None, 0.0))[0] is not character:
                self._edited[name] = character, now
            elif now - self._edited[name][1] >= _SEND_DELAY_S:
                self.send(stage, project, name)

    def send_all_again(self, stage: StageLink, project: Project) -> None:
        """Sends everything again to a restarted edge, which has an empty stage."""
        for name in [name for name in self._sent if name in project.characters]:
            self.send(stage, project, name)

    def forget(self) -> None:
        """Discards the state of the stage after the connection was closed."""
        self.states, self._sent, self._edited = {}, {}, {}

    def _handle_answer(self, name: str, again: bool, answer: Answer) -> None:
        if name not in self._sent:
            return
        if isinstance(answer, Done):
            self.states[name] = "on the stage"
            if not again:
                self._show_message(tr("{0} is on the stage", name), self._make_placement_note(name))
        elif isinstance(answer, Refused):
            self.states[name] = later("refused: {0}", answer.reason)
            self._show_message(tr("{0} cannot be put on the stage", name), answer.reason)

    def _make_placement_note(self, name: str) -> str:
        """Returns a note for the artist about a character that was put on the stage."""
        if texture_bytes(self._sent[name]) > MAX_TEXTURE_BYTES:
            max_megabytes = MAX_TEXTURE_BYTES >> 20
            return tr(
                "The character's textures have more than {0} MB, so they are not sent. Make the texture "
                "images smaller.",
                max_megabytes,
            )
        return tr("The character on the stage follows every edit.")

    def _handle_removal(self, name: str, answer: Answer) -> None:
        if isinstance(answer, Refused):
            self._show_message(tr("{0} was not removed from the stage", name), answer.reason)
        else:
            self._show_message(tr("{0} was removed from the stage", name), "")


def differs_in_motion_only(character: RigBase, sent: RigBase) -> bool:
    """Returns True if an edit changed only the motion of a character, and the edge does not need the motion.

    Such an edit is not sent.
    """
    names = character.sent_by
    is_same_rig = bool(names) and names == sent.sent_by
    return is_same_rig and all(
        getattr(character, attribute) is getattr(sent, attribute) for attribute in names
    )


class StageAccess(Protocol):
    """The session that is connected to the stage."""

    editor: Editor

    @property
    def connected(self) -> bool:
        """Returns True if messages arrive from an edge."""

    @property
    def stage(self) -> StageLink | None:
        """Returns the stage of the edge, or None without an edge."""

    @property
    def stage_ids(self) -> tuple[str, ...]:
        """Returns the ids of the characters on the stage."""

    def describe_missing_edge(self) -> str:
        """Returns the reason why no edge can be used, or an empty text if one can be used."""

    def check_availability(self, lacking: str) -> bool:
        """Returns True if ``lacking`` is empty. Otherwise shows it as a message."""


class StagedCharacters:
    """Puts characters of the project on the stage, now or once a stage is connected.

    Attributes:
        sender: sends the characters, and sends them again after edits.
        waiting: the characters that wait for the next stage.
    """

    def __init__(self, session: StageAccess) -> None:
        self._session, self._editor = session, session.editor
        self.sender = StageSender(session.editor.toasts.show_message)
        self.waiting: tuple[str, ...] = ()

    def describe_missing_to_put(self) -> str:
        """Returns the reason why the selected character cannot be put on the stage, with advice. The text is
        empty if it can.
        """
        character, no_edge = self._editor.find_selected(), self._session.describe_missing_edge()
        if character is None:
            return no_edge or "Nothing is chosen. Click the character that you want to put on the stage"
        no_surface_text = (
            "The chosen shape has no surface, so it cannot be possessed" if character.mesh is None else ""
        )
        return no_edge or no_surface_text

    def describe_missing_to_remove(self) -> str:
        """Returns the reason why the selected character cannot leave the stage, with advice, or an empty
        text if it can.
        """
        is_on_stage = self._editor.selection.character in self._session.stage_ids
        return self._session.describe_missing_edge() or (
            "" if is_on_stage else "The chosen character is not on the stage. Choose a character on the stage"
        )

    def put_selected(self) -> None:
        """Puts the selected character on the stage, where it follows every edit."""
        stage = self._session.stage
        if self._session.check_availability(self.describe_missing_to_put()) and stage is not None:
            self.sender.send(stage, self._editor.project, self._editor.selection.character or "")

    def put_when_ready(self, name: str) -> None:
        """Puts a character on the stage, or on the next connected stage if there is none now."""
        self.waiting = (*(other for other in self.waiting if other != name), name)
        if not self._session.connected:
            message = tr("{0} will be put on the stage once a stage is connected", name)
            self._editor.toasts.show_message(
                message, tr("Connect to a camera or to a recorded person in the panel at the right.")
            )

    def remove(self, name: str = "") -> None:
        """Removes a character from the stage, by default the selected character."""
        stage, lacking = self._session.stage, "" if name else self.describe_missing_to_remove()
        if self._session.check_availability(lacking) and stage is not None:
            self.sender.remove(stage, name or self._editor.selection.character or "")

    def keep_for_next_stage(self) -> None:
        """Lets the characters on the stage wait for the next one, because the stage will end."""
        states = self.sender.states.items()
        on_stage = (name for name, state in states if not state.startswith("refused"))
        self.waiting = tuple(dict.fromkeys((*self.waiting, *on_stage)))

    def advance(self) -> None:
        """Puts the waiting characters on a connected stage, and sends edited ones again."""
        stage, session = self._session.stage, self._session
        if stage is None:
            return
        if session.connected:
            names, self.waiting = self.waiting, ()
            for name in names:
                if name in self._editor.project.characters and name not in session.stage_ids:
                    self.sender.send(stage, self._editor.project, name)
        self.sender.advance(stage, self._editor.project)

    def send_all_again(self) -> None:
        """Puts all characters on the empty stage of a restarted edge."""
        if self._session.stage is not None:
            self.sender.send_all_again(self._session.stage, self._editor.project)
