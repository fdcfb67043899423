"""Switches of the stage that the edge owns and reports: voice commands and loose objects."""

from __future__ import annotations

import time
from typing import Generic, Literal, TypeVar, get_args

from enliven.wire import (
    HEARD,
    PHYSICS,
    VOICE,
    Answer,
    HeardMessage,
    Listen,
    PhysicsMessage,
    PlayPhysics,
    Refused,
    Topic,
    VoiceMessage,
)
from enliven_viewer.language import later, tr
from enliven_viewer.link.edge_client import EdgeClient
from enliven_viewer.studio.editor.editor import Editor

NOT_READY_TEXT = later("Waiting for the stage")
"""Text that is shown while the edge has not sent the state yet."""
MAX_FIRST_STATE_DELAY_S = 3.0
"""If the state is still missing this number of seconds after an edge's first message, the edge is too old. A
new edge sends its states immediately. The subscription and a busy machine delay them by up to a second.
"""
Message = TypeVar("Message")


class TopicState(Generic[Message]):
    """The last message of a topic that has one message for the whole edge.

    Attributes:
        message: the last message; None before the edge has sent one.
    """

    def __init__(self, topic: Topic) -> None:
        self._topic = topic
        self.message: Message | None = None
        self._instance: int | None = None
        self._connected_since = 0.0

    def advance(self, client: EdgeClient) -> None:
        """Reads the messages that arrived."""
        client.take(self._topic)
        self.message = client.latest(self._topic).get("")
        instance = client.edges[0].instance
        if instance != self._instance:
            self._instance, self._connected_since = instance, time.monotonic()

    def forget(self) -> None:
        """Discards the state after the connection was closed."""
        self.message = self._instance = None

    @property
    def is_unsupported(self) -> bool:
        """Returns True if a connected edge does not publish this state, because it is an older version."""
        waited = (
            self._instance is not None and time.monotonic() - self._connected_since > MAX_FIRST_STATE_DELAY_S
        )
        return self.message is None and waited


UTTERANCE_DISPLAY_S = 5.0
"""Seconds for which an utterance is shown: long enough to read, and usually shorter than the time to the next
utterance.
"""
_NO_VOICE = later(
    "The stage runs an older version, without a switch for the microphone. Update enliven on its computer"
)
_STATE_TEXTS = {
    "off": later("The microphone is off"),
    "starting": later("The microphone is being opened"),
    "listening": later("Listening"),
    "missing": later("No microphone"),
}


class StageVoice:
    """The state of an edge's voice control, and the commands that open or close its microphone.

    Attributes:
        wanted_state: True to open the microphone of an edge that this window starts, once that edge runs.
    """

    def __init__(self, editor: Editor) -> None:
        self._editor = editor
        self.wanted_state = False
        self._state: TopicState[VoiceMessage] = TopicState(VOICE)
        self._heard: HeardMessage | None = None
        self._heard_until = 0.0
        self._asked_edge: object = None

    def advance(self, client: EdgeClient, *, is_near: bool) -> None:
        """Processes the edge's messages. Opens the microphone of an edge that this window has started, if
        requested.
        """
        for message in client.take(HEARD):
            self._heard, self._heard_until = message, time.monotonic() + UTTERANCE_DISPLAY_S
        self._state.advance(client)
        instance = client.edges[0].instance
        if is_near and self.wanted_state and self.state is not None and self._asked_edge != instance:
            self._asked_edge = instance
            self._send_request(client, True)

    def forget(self) -> None:
        """Discards the edge's state after the connection was closed."""
        self._state.forget()
        self._heard = self._asked_edge = None

    @property
    def state(self) -> VoiceMessage | None:
        """Returns the state of the microphone, or None before the edge has sent it."""
        return self._state.message

    @property
    def is_on(self) -> bool:
        """Returns True if the microphone is open or opening."""
        return self.state is not None and self.state.state != "off"

    @property
    def is_understood(self) -> bool:
        """Returns True if the displayed utterance is one of the known phrases."""
        return self._heard is not None and self._heard.understood

    @property
    def heard_words(self) -> str:
        """Returns the words recognised in the last seconds, or an empty text if there are none."""
        heard = self._heard
        if heard is None or time.monotonic() > self._heard_until:
            return ""
        if heard.understood:
            return tr("Heard: {0}", heard.words) + (f" ({heard.refused})" if heard.refused else "")
        return tr("Not understood: {0}", heard.words) if heard.words else tr("Not understood")

    @property
    def status(self) -> str:
        """Returns a displayed text about the state of the microphone."""
        if self.state is None:
            return _NO_VOICE if self._state.is_unsupported else NOT_READY_TEXT
        reason = f": {self.state.what}" if self.state.what else ""
        return f"{_STATE_TEXTS[self.state.state]}{reason}"

    @property
    def advice(self) -> str:
        """Returns advice on fixing the microphone, or about what to say."""
        if self.state is None:
            return ""
        if self.state.state == "missing":
            return self.state.remedy
        return (
            tr("Say: {0} ...", ", ".join(self.state.phrases[:2])) if self.state.state == "listening" else ""
        )

    @property
    def phrases(self) -> tuple[tuple[str, str], ...]:
        """Returns the known phrases, each with its command."""
        return () if self.state is None else tuple(zip(self.state.phrases, self.state.actions, strict=True))

    def toggle(self, client: EdgeClient | None) -> None:
        """Opens or closes the microphone."""
        self.wanted_state = not self.is_on
        if client is not None and self.state is not None:
            self._send_request(client, self.wanted_state)

    def _send_request(self, client: EdgeClient, on: bool) -> None:
        client.ask(Listen(on), self._handle_answer)

    def _handle_answer(self, answer: Answer) -> None:
        if isinstance(answer, Refused):
            self.wanted_state = False
            self._editor.toasts.show_message(
                tr("The microphone could not be switched on or off"), answer.reason
            )


LooseWorld = Literal["none", "boxes", "dodgeball"]
LOOSE_WORLDS: tuple[LooseWorld, ...] = get_args(LooseWorld)
LOOSE_LABELS = (later("No objects"), later("Towers of boxes"), later("Dodgeball"))
"""Displayed name of each of :data:`LOOSE_WORLDS`."""
_NO_PHYSICS = later(
    "The stage runs an older version of enliven. Start its camera program with --physics boxes."
)
_STATE_HINTS = {
    "off": later("Adds boxes or balls that a character can knock over."),
    "preparing": later("The objects are being prepared."),
    "on": later(
        "The objects appear once a performer stands still. Possess a character, and knock them over."
    ),
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
        is_on = self.state is not None and self.state.state in ("preparing", "on")
        return LOOSE_WORLDS.index(self.state.world) if is_on and self.state is not None else 0

    @property
    def state_text(self) -> str:
        """Returns advice on how to get objects, or the reason why there are none, in at most
        two sentences.
        """
        state = self.state
        if state is None:
            return _NO_PHYSICS if self._state.is_unsupported else NOT_READY_TEXT
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
            self._editor.toasts.show_message(tr("This stage has no physics"), answer.reason)
