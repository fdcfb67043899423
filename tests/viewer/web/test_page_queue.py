"""Tests of a web page's message queue: it keeps only the newest messages, and only as many as the page
draws.
"""

from __future__ import annotations

import asyncio

import msgspec
import pytest

from enliven_viewer.web.page_queue import CHARACTER_PREFIX, PageQueue

LOOP = asyncio.new_event_loop()
"""The event loop of all tests. A queue belongs to one loop."""


def take(queue: PageQueue) -> list | str:
    """Returns the next message, decoded. Raises TimeoutError if there is none."""
    data = LOOP.run_until_complete(asyncio.wait_for(queue.next(), 0.05))
    return data if isinstance(data, str) else msgspec.msgpack.decode(data)


def assert_empty(queue: PageQueue) -> None:
    with pytest.raises(TimeoutError):
        take(queue)


def test_characters_precede_their_poses() -> None:
    queue = PageQueue()
    queue.put([("pose chair", b"pose"), (CHARACTER_PREFIX + "chair", b"character")])
    assert take(queue) == [1, [b"character", b"pose"]]


def test_page_without_answers_gets_two_batches_then_the_newest() -> None:
    queue = PageQueue()
    for number in range(10):
        queue.put([("pose chair", b"%d" % number)])
        if number < 2:
            assert take(queue) == [number + 1, [b"%d" % number]]
    assert_empty(queue)
    queue.answer(1)
    assert take(queue) == [3, [b"9"]]
    assert_empty(queue)


def test_answers_for_later_batches_than_were_sent_count_as_the_last() -> None:
    queue = PageQueue()
    queue.answer(10**9)
    for number in range(4):
        queue.put([("pose chair", b"")])
        if number < 2:
            assert take(queue)[0] == number + 1
    assert_empty(queue)


def test_state_does_not_wait_for_answers() -> None:
    queue = PageQueue()
    for _ in range(2):
        queue.put([("pose chair", b"")])
        take(queue)
    queue.put([("pose chair", b"")])
    queue.put_state("old")
    queue.put_state("new")
    assert take(queue) == "new"
    assert_empty(queue)


def test_messages_of_characters_that_left_are_not_sent() -> None:
    queue = PageQueue()
    queue.put([("pose chair", b"1"), ("pose lamp", b"2")])
    queue.forget(["pose chair"])
    assert take(queue) == [1, [b"2"]]
