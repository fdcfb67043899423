"""Checks that the optional libraries of the controls are installed."""

from __future__ import annotations

import importlib.util

from enliven.errors import ResourceError


def need(module: str, extra: str, where: str) -> None:
    """Raises an error that names the missing package.

    Raises:
        ResourceError: where it is.
    """
    if importlib.util.find_spec(module) is None:
        raise ResourceError(
            f"the library {module!r} is not installed here",
            where=where,
            mend=f'Install it: pip install "enliven-edge[{extra}]" (here: pip install "./edge[{extra}]").',
        )
