"""Names for the array types in signatures. Docstrings describe the shapes."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Float = NDArray[np.float64]
Float32 = NDArray[np.float32]
Complex = NDArray[np.complex128]
Int = NDArray[np.int64]
Int32 = NDArray[np.int32]
UInt8 = NDArray[np.uint8]
Int16 = NDArray[np.int16]
UInt16 = NDArray[np.uint16]
Bool = NDArray[np.bool_]
AnyArray = NDArray[Any]


def frozen(array: AnyArray, kind: Any = np.float64) -> AnyArray:
    """Returns a read-only array with the type ``kind``.

    An array that is already read-only and has this type is returned without a copy, so that objects share
    arrays.
    """
    if isinstance(array, np.ndarray) and array.dtype == kind and not array.flags.writeable:
        return array
    copied = np.array(array, kind)
    copied.setflags(write=False)
    return copied


def freeze(value: object, *names: str, kind: Any = np.float64) -> None:
    """Converts the named attributes of a frozen dataclass to read-only arrays."""
    for name in names:
        object.__setattr__(value, name, frozen(getattr(value, name), kind))
