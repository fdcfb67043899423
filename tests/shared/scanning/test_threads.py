"""Tests of work shared by two threads: each item is done once, and errors are raised."""

import threading

import pytest

from enliven.kernels import run_in_pieces
from enliven.scanning.threads import compute_ahead, run_in_two_threads


def test_each_item_is_done_once_by_a_thread_with_a_tool_of_its_own():
    done, tools = [], []

    def tool():
        tools.append(threading.get_ident())
        return tools[-1]

    def do(mine, item):
        assert mine == threading.get_ident()
        pieces = []
        # A function that distributes work may be called within such work.
        run_in_pieces(lambda first, last: pieces.extend(range(first, last)), 10, 3)
        assert sorted(pieces) == list(range(10))
        done.append(item)

    run_in_two_threads(do, list(range(50)), tool)
    assert sorted(done) == list(range(50)) and len(tools) == len(set(tools))


@pytest.mark.parametrize("failing", [0, 7, 19])
def test_error_in_either_thread_is_raised_and_next_call_works(failing):
    def do(_, item):
        if item == failing:
            raise ValueError(str(item))

    with pytest.raises(ValueError, match=str(failing)):
        run_in_two_threads(do, list(range(20)), lambda: None)
    run_in_two_threads(lambda tool, item: None, [1, 2, 3], lambda: None)


def test_items_that_are_made_ahead_keep_their_order_and_their_errors():
    assert list(compute_ahead(iter(range(20)))) == list(range(20))
    assert list(compute_ahead(iter([]))) == []

    def broken():
        yield 1
        raise ValueError("the second")

    items = compute_ahead(broken())
    assert next(items) == 1
    with pytest.raises(ValueError, match="the second"):
        next(items)
