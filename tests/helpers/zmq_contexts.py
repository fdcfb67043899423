"""ZeroMQ contexts for tests, which a test cannot leave open by mistake.

If Python garbage-collects a context while one of its sockets is open, libzmq waits for that socket for ever.
This happens during another test, which then seems to hang. :func:`make_context` therefore keeps a reference
to each context until it is closed. A fixture for all tests fails in the file that forgot a context.
"""

from __future__ import annotations

from typing import Any

import zmq

_CONTEXTS: list[zmq.Context[Any]] = []
"""Contexts that :func:`close_leaked_contexts` has not checked yet."""


def make_context() -> zmq.Context[Any]:
    """Returns a context. When its sockets are closed, they drop the messages that no peer has received."""
    context: zmq.Context[Any] = zmq.Context()
    context.linger = 0
    _CONTEXTS.append(context)
    return context


def close_leaked_contexts() -> int:
    """Closes the contexts that are still open and returns their number."""
    forgotten = [context for context in _CONTEXTS if not context.closed]
    _CONTEXTS.clear()
    for context in forgotten:
        context.destroy(linger=0)
    return len(forgotten)
