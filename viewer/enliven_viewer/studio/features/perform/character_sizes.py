"""Sizes of the characters on the stage, and the exaggeration of soft parts.

They are edits, so undo affects the stage.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Collection

import numpy as np

from enliven.document import FREE
from enliven.modeling.edits import handle_characters
from enliven.wire import SIZES, Answer, Order, Refused, Resize, SizeMessage
from enliven_viewer.language import later, tr
from enliven_viewer.link.edge_client import EdgeClient
from enliven_viewer.studio.editor.editor import Editor

_SIZE_TOLERANCE = 0.005
"""Relative difference below which two sizes count as equal. An edge ignores such a difference too."""
_RESEND_INTERVAL_S = 1.0
"""Seconds after which a size is sent again, because a restarted edge has lost it."""
_TEXT_S = 3.0
"""Seconds for which the text stays after scaling has ended."""


class CharacterSizes:
    """Synchronises character sizes: reads them from the edge, and sends the project's sizes to the edge.

    Attributes:
        text: the large text: the character with its size, and the effect of moving the hands; None for no
            text.
    """

    def __init__(self, editor: Editor) -> None:
        self._editor = editor
        self.text: tuple[str, str] | None = None
        self._edge_sizes: dict[str, SizeMessage] = {}
        self._sent_values: dict[tuple[str, str], tuple[float | None, float]] = {}
        self._text_until = 0.0

    @property
    def scaled_character(self) -> str | None:
        """Returns the character that a performer is scaling with the hands, or None if there is none."""
        return next((name for name, message in self._edge_sizes.items() if message.body >= 0), None)

    def find_size(self, name: str) -> float:
        """Returns the scale factor of a character on the stage, relative to its original size."""
        return self._edge_sizes[name].size if name in self._edge_sizes else 1.0

    def compute_wanted_size(self, name: str) -> float:
        """Returns the scale factor that a character of the project should have on the stage."""
        return self._editor.project.handling.get(name, FREE).size

    def advance(self, client: EdgeClient, standing: Collection[str]) -> None:
        """Reads sizes from the edge, stores sizes set by gestures, and sends the project's sizes if they
        differ.
        """
        client.take(SIZES)
        old_sizes, self._edge_sizes = self._edge_sizes, {}
        for message in client.latest(SIZES).values():
            if message.character in standing:
                self._edge_sizes[message.character] = message
        self._update_text(old_sizes)
        for name in standing:
            self._send_exaggeration(name, client)
        if self._editor.draft is not None:
            return
        for name in standing:
            if name not in self._editor.project.characters or name == self.scaled_character:
                continue
            if name in old_sizes and old_sizes[name].body >= 0:
                self._store_size(name)
            elif abs(self.find_size(name) / self.compute_wanted_size(name) - 1.0) > _SIZE_TOLERANCE:
                size = self.compute_wanted_size(name)
                self._send_value(client, Resize("set", name, size=size), size)

    def forget(self) -> None:
        """Discards the edge's sizes after the connection was closed."""
        self.text, self._edge_sizes, self._sent_values = None, {}, {}

    def reset(self, name: str | None, ask: Callable[[Order], object]) -> None:
        """Resets the size of a character. This is an edit if the character is in the project."""
        if name in self._editor.project.characters:
            self._edit(name, 1.0)
        elif name is not None:
            ask(Resize("set", name))

    def describe_missing_size(self, name: str | None) -> str:
        """Returns the reason why the size cannot be reset, with advice, or an empty text if it
        can be reset.
        """
        if (
            name is not None
            and max(abs(self.find_size(name) - 1.0), abs(self.compute_wanted_size(name) - 1.0))
            > _SIZE_TOLERANCE
        ):
            return ""
        return "The character already has its original size. Scale it with both hands first"

    def _update_text(self, before: dict[str, SizeMessage]) -> None:
        """Updates the displayed text."""
        now = time.monotonic()
        if self.scaled_character is not None:
            size = f"{self.scaled_character}: {self.find_size(self.scaled_character):.0%}"
            self.text = size, tr("Hands apart: larger. Hands together: smaller. Hold still to keep the size.")
            self._text_until = now + _TEXT_S
        elif self.text is not None:
            released_name = next((name for name, message in before.items() if message.body >= 0), None)
            if released_name is not None:
                self.text = f"{released_name}: {self.find_size(released_name):.0%}", tr("This size is kept.")
                self._editor.frame_all(reset=False)
            if now > self._text_until:
                self.text = None

    def _store_size(self, name: str) -> None:
        """Stores a size that was set by a gesture as an edit of the project."""
        if abs(self.find_size(name) / self.compute_wanted_size(name) - 1.0) > _SIZE_TOLERANCE:
            self._edit(name, self.find_size(name))

    def _edit(self, name: str, size: float) -> None:
        self._editor.edit(
            later("size of {0}: {1:.0%}", name, size),
            lambda project: handle_characters(project, [name], size=size),
            over_locks=True,
        )

    def _send_exaggeration(self, name: str, client: EdgeClient) -> None:
        """Sends the exaggeration of soft parts if the value of the project, or of a current drag, differs
        from the edge's.
        """
        project = self._editor.draft or self._editor.project
        edge_exaggeration = self._edge_sizes[name].exaggeration if name in self._edge_sizes else None
        exaggeration = project.handling.get(name, FREE).exaggeration
        if name in project.characters and exaggeration != edge_exaggeration:
            self._send_value(client, Resize("exaggerate", name, exaggeration=exaggeration), exaggeration)

    def _send_value(self, client: EdgeClient, order: Resize, wanted: float | None) -> None:
        """Sends a value of the project to the edge. Does not repeat it while an answer may still arrive, or
        after a refusal.
        """
        key, now = (order.do, order.character or ""), time.monotonic()
        sent_value, when = self._sent_values.get(key, (np.nan, -_RESEND_INTERVAL_S))
        if sent_value != wanted or now - when > _RESEND_INTERVAL_S:
            self._sent_values[key] = wanted, now
            client.ask(order, lambda answer: self._handle_answer(order, wanted, answer))

    def _handle_answer(self, order: Resize, wanted: float | None, answer: Answer) -> None:
        if isinstance(answer, Refused):
            self._sent_values[order.do, order.character or ""] = wanted, float("inf")
            outcome = tr("keeps its size") if order.do == "set" else tr("swings as before")
            self._editor.toasts.show_message(
                tr("{0} {1} on the stage", order.character, outcome), answer.reason
            )
