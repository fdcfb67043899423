"""Main program of the sending process: receives frames, encodes them and sends them.

It ends when the connection is closed, so it never outlives the program that started it.
"""

from __future__ import annotations

import contextlib
import faulthandler
import logging
import os
import pickle
import signal
import sys
import threading
from collections.abc import Sequence

from enliven.errors import EnlivenError
from enliven.outputs.depth_memory import DepthMemory
from enliven.outputs.frame_thread import FrameThread
from enliven.outputs.process.frame_codec import FrameDecoder
from enliven.outputs.process.message_stream import MessageStream, open_inherited_end
from enliven.outputs.sender import Sender

_STATE_INTERVAL_S = 0.25
"""Interval in seconds between two reports of the state. Only a changed state is reported."""
_MAX_END_S = 4.0
"""Maximum time in seconds for closing the outputs. After it, the process exits without closing them."""
_FAILURE = 1
"""Exit code of a process that could not open its outputs."""


def main(arguments: Sequence[str]) -> int:
    """Sends frames until the connection is closed. Returns the exit code."""
    # Ctrl-C and the stop of a service send signals to all processes. Ignore them, so that the last frame is
    # sent before this process ends.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    if sys.stderr is not None:
        faulthandler.enable()
    reports = _Reports(MessageStream(open_inherited_end(arguments)))
    messages = reports.stream.receive()
    while messages == []:
        messages = reports.stream.receive()
    if messages is None:
        return 0
    (_, (plans, handle)), *_ = messages
    _log_to(reports)
    with contextlib.ExitStack() as stack:
        memory = None if handle is None else stack.enter_context(DepthMemory(handle))
        try:
            senders = [stack.enter_context(plan.open()) for plan in plans]
        except EnlivenError as error:
            reports.send("failed", str(error))
            return _FAILURE
        thread = FrameThread(senders)
        states = _StateReports(reports, thread, senders)
        reports.send("ready", None)
        decoder = FrameDecoder(lambda reference: None if memory is None else memory.read(reference))
        _receive(reports.stream, decoder, thread, senders)
        _end_within(_MAX_END_S)
        thread.close()
        states.close()
    return 0


def _receive(
    stream: MessageStream, decoder: FrameDecoder, thread: FrameThread, senders: Sequence[Sender]
) -> None:
    """Passes received frames and health states to the outputs until the connection is closed."""
    while (messages := stream.receive()) is not None:
        for kind, content in messages:
            if kind == "frame":
                thread.put(decoder.decode(content))
            elif kind == "health":
                for sender in senders:
                    sender.put_health(content)


def _end_within(seconds: float) -> None:
    """Ends the process after ``seconds``, even if a library call never returns."""
    timer = threading.Timer(seconds, os._exit, (0,))
    timer.daemon = True
    timer.start()


def _log_to(reports: _Reports) -> None:
    """Redirects all log messages to the program that started this process."""
    logging.getLogger().addHandler(reports)
    logging.getLogger().setLevel(logging.INFO)


class _Reports(logging.Handler):
    """A log handler that sends reports and log messages to the program. If the program has ended, they are
    dropped."""

    def __init__(self, stream: MessageStream) -> None:
        super().__init__()
        self.stream = stream
        self._sending = threading.Lock()

    def send(self, kind: str, content: object) -> None:
        """Sends a report."""
        with self._sending, contextlib.suppress(OSError):
            self.stream.send(kind, content)

    def emit(self, record: logging.LogRecord) -> None:
        try:
            self.send("log", (record.name, record.levelno, self.format(record)))
        except (TypeError, ValueError, pickle.PicklingError):
            self.handleError(record)


class _StateReports:
    """A thread that reports the state of the outputs whenever it has changed."""

    def __init__(self, reports: _Reports, thread: FrameThread, senders: Sequence[Sender]) -> None:
        self._reports, self._frames, self._senders = reports, thread, senders
        self._last: object = None
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._run, name="state of live outputs", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Reports the final state, and ends the thread."""
        self._ended.set()
        self._thread.join()
        self._report()

    def _run(self) -> None:
        while not self._ended.wait(_STATE_INTERVAL_S):
            self._report()

    def _report(self) -> None:
        rows = [(sender.sent, sender.errors, sender.trouble) for sender in self._senders]
        state = self._frames.skipped, any(sender.wants_depth for sender in self._senders), rows
        if state != self._last:
            self._last = state
            self._reports.send("state", state)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
