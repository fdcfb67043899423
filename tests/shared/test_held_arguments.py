"""Tests of held kernel arguments: kernels use the held arrays themselves, which are released with the
pointer.
"""

import weakref
from collections import namedtuple

import numpy as np
import pytest
from numba.core.errors import TypingError

from enliven.kernels import hold, njit

Room = namedtuple("Room", "numbers scale")
Both = namedtuple("Both", "first second count")


@njit()
def write(held, at):
    """Writes the scaled value of the second array at an index into the first array."""
    both = held.values
    both.first.numbers[at] = both.second.scale * both.second.numbers[at]
    return both.count


@njit()
def passed_on(held):
    return held


def held_pair():
    first, second = np.zeros(3), np.arange(3.0)
    return first, second, hold(Both(Room(first, 1.0), Room(second, 10.0), 7))


def test_a_kernel_reads_and_writes_the_arrays_that_were_held():
    first, second, held = held_pair()
    assert write(held, 2) == 7
    np.testing.assert_array_equal(first, [0.0, 0.0, 20.0])
    second[1] = 5.0
    write(held, 1)
    np.testing.assert_array_equal(first, [0.0, 50.0, 20.0])


def test_arrays_live_as_long_as_they_are_held_and_no_longer():
    first, second, held = held_pair()
    kept = weakref.ref(first)
    del first
    for _ in range(100):
        write(held, 0)
    again = passed_on(held)
    del held
    second[2] = 4.0
    write(again, 2)
    assert kept()[2] == 40.0
    del again
    assert kept() is None


def test_unsupported_argument_is_refused():
    with pytest.raises(TypingError, match="Cannot determine Numba type"):
        hold(object())


def test_a_kernel_is_compiled_once_for_all_of_one_type():
    _, _, holder = held_pair()
    _, _, other = held_pair()
    write(holder, 0)
    before = len(write.overloads)
    write(other, 0)
    assert len(write.overloads) == before
