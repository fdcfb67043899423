"""Physics in the studio: switches the loose objects on an edge's stage."""

from __future__ import annotations

from typing import Literal, get_args

from enliven.wire import PHYSICS, Answer, PhysicsMessage, PlayPhysics, Refused
from enliven_viewer.language import later, tr
from enliven_viewer.link.edge_client import EdgeClient
from enliven_viewer.studio.editor.editor import Editor
from enliven_viewer.studio.perform.topic_state import NOT_READY_TEXT, TopicState

LooseWorld = Literal["none", "boxes", "dodgeball"]
LOOSE_WORLDS: tuple[LooseWorld, ...] = get_args(LooseWorld)
LOOSE_LABELS = (later("Nothing loose"), later("Towers of boxes"), later("Dodgeball"))
"""Displayed name of each of :data:`LOOSE_WORLDS`."""
_OLD_EDGE = later("This stage's program is older: start it with --physics boxes.")
_STATE_HINTS = {
    "off": later("Boxes and balls that a character can knock over."),
    "preparing": later("The objects are being made ready."),
    "on": later("They appear once a performer stands still. Step in, and knock them over."),
}


class StagePhysics:
    """The state of an edge's physics, and the commands that switch it."""

    def __init__(self, editor: Editor) -> None:
        self._editor = editor
        self._state: TopicState[PhysicsMessage] = TopicState(PHYSICS)

    def advance(self, client: EdgeClient) -> None:
        """Processes the edge's messages."""
        self._state.advance(client)

    def forget(self) -> None:
        """Discards the edge's state after the connection was closed."""
        self._state.forget()

    @property
    def state(self) -> PhysicsMessage | None:
        """Returns the state of the physics, or None before the edge has sent it."""
        return self._state.message

    @property
    def number(self) -> int:
        """Returns the index of the current entry of :data:`LOOSE_WORLDS`."""
        on = self.state is not None and self.state.state in ("preparing", "on")
        return LOOSE_WORLDS.index(self.state.world) if on and self.state is not None else 0

    @property
    def words(self) -> str:
        """Returns advice on how to get objects, or the reason why there are none, in at most
        two sentences.
        """
        state = self.state
        if state is None:
            return _OLD_EDGE if self._state.is_unsupported else NOT_READY_TEXT
        if state.state in _STATE_HINTS:
            return _STATE_HINTS[state.state]
        return f"{state.what[:1].upper()}{state.what[1:]}. {state.remedy}"

    @property
    def has_problem(self) -> bool:
        """Returns True if :meth:`words` describes a problem."""
        return self.state is not None and self.state.state in ("missing", "failed")

    def ask(self, client: EdgeClient | None, number: int) -> None:
        """Requests entry ``number`` of :data:`LOOSE_WORLDS` on the stage."""
        if client is not None and self.state is not None:
            client.ask(PlayPhysics(LOOSE_WORLDS[number]), self._handle_answer)

    def _handle_answer(self, answer: Answer) -> None:
        if isinstance(answer, Refused):
            self._editor.toasts.say(tr("This stage has no physics"), answer.reason)
