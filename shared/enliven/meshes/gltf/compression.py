"""Decodes what Draco compressed: the accessors of a primitive get their values from its compressed bytes."""

from __future__ import annotations

from typing import Any

import numpy as np

from enliven.arrays import AnyArray
from enliven.errors import InputError
from enliven.meshes.gltf.extensions import DRACO


def draco_arrays(data: bytes, attributes: dict[str, int]) -> tuple[dict[str, AnyArray], AnyArray]:
    """Returns the attributes (V, C) of a compressed mesh by name, and the corners of its faces (3 F, 1).

    Args:
        data: what the extension's buffer view holds.
        attributes: the number of each attribute in the compressed mesh.

    Raises:
        InputError: where the bytes are damaged, or lack an attribute.
    """
    import DracoPy  # only files that are compressed need it

    try:
        mesh = DracoPy.decode(data)
        held: dict[int, Any] = {each["unique_id"]: each["data"] for each in mesh.attributes}
        faces = np.asarray(mesh.faces, np.uint32).reshape(-1, 1)
    except Exception:  # a library that reads strangers' bytes raises whatever it likes
        raise InputError(f"its data compressed by {DRACO} is damaged") from None
    lacking = [name for name, number in attributes.items() if number not in held]
    if lacking:
        raise InputError(f"its data compressed by {DRACO} lacks {', '.join(lacking[:5])}")
    arrays = {name: np.asarray(held[number]) for name, number in attributes.items()}
    return {name: array.reshape(len(array), -1) for name, array in arrays.items()}, faces
