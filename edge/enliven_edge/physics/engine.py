"""Checks that the physics engine, an extra, is installed."""

from __future__ import annotations

import importlib.util

from enliven.errors import ResourceError


def need_engine() -> None:
    """Raises an error that names the missing package.

    Raises:
        ResourceError: where it is.
    """
    if importlib.util.find_spec("mujoco") is None:
        raise ResourceError(
            "the physics engine is not installed here",
            where="--physics",
            mend='Install it: pip install "enliven-edge[physics]" (here: pip install "./edge[physics]").',
        )
