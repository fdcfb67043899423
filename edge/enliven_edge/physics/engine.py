"""Whether the physics engine is here: it is an extra."""

from __future__ import annotations

import importlib.util

from enliven.errors import ResourceError


def need_engine() -> None:
    """Says what to install where the engine is missing.

    Raises:
        ResourceError: where it is.
    """
    if importlib.util.find_spec("mujoco") is None:
        raise ResourceError(
            "the physics engine is not installed here",
            where="--physics",
            mend='Install it: pip install "enliven-edge[physics]" (here: pip install "./edge[physics]").',
        )
