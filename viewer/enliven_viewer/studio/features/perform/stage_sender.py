"""Sends characters of the project to the stage of an edge, updates them after edits, and removes them."""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial

from enliven.document import Project, RigBase
from enliven.formats.project.one_character import texture_bytes
from enliven.wire import MAX_TEXTURE_BYTES, Answer, Done, Refused
from enliven_viewer.language import later, tr
from enliven_viewer.link.stage_link import StageLink

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
            if character is not None and _differs_in_motion_only(character, sent):
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


def _differs_in_motion_only(character: RigBase, sent: RigBase) -> bool:
    """Returns True if an edit changed only the motion of a character, and the edge does not need the motion.

    Such an edit is not sent.
    """
    names = character.sent_by
    is_same_rig = bool(names) and names == sent.sent_by
    return is_same_rig and all(
        getattr(character, attribute) is getattr(sent, attribute) for attribute in names
    )
