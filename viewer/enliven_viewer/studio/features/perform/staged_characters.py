"""The project's characters on the stage of an edge: the user puts them there and removes them."""

from __future__ import annotations

from typing import Protocol

from enliven_viewer.language import tr
from enliven_viewer.link.stage_link import StageLink
from enliven_viewer.studio.editor.editor import Editor
from enliven_viewer.studio.features.perform.stage_sender import StageSender


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
