"""Arguments that a kernel takes call after call: looked at once, and handed over as one pointer.

Numba looks at every array of a call, 0.15 microseconds each: of a frame of a deformation graph with 128
nodes, whose kernel takes 53, that was a sixteenth. A pointer to all of them costs what one array costs.
"""

from __future__ import annotations

from numba.core import types
from numba.experimental import structref
from numba.extending import overload

from enliven.kernels import njit


@structref.register
class HeldType(types.StructRef):  # type: ignore[misc]
    """The type of held arguments in a kernel; ``values``, its one field, is what :func:`hold` was given."""


class Held(structref.StructRefProxy):  # type: ignore[misc]
    """A pointer to arguments, made by :func:`hold`: a kernel reads its ``values``."""

    __slots__ = ()


structref.define_boxing(HeldType, Held)


def _held(values):  # type: ignore[no-untyped-def]
    """Stands for what kernels compile in its place, below."""
    raise NotImplementedError("it is called in kernels alone")


@overload(_held)
def _held_in_kernels(values):  # type: ignore[no-untyped-def]
    """Returns how a kernel makes a structure of values of these types."""
    kind = HeldType((("values", types.unliteral(values)),))

    def make(values):  # type: ignore[no-untyped-def]
        held = structref.new(kind)
        held.values = values
        return held

    return make


@njit(cache=True)
def hold(values):  # type: ignore[no-untyped-def]
    """Returns a :class:`Held` of arrays, numbers, and tuples and named tuples of them.

    The arrays are not copied: what is written into one is seen by the kernel. Numbers are as they were.
    """
    return _held(values)
