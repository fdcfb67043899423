"""Checks that optional libraries are installed."""

from __future__ import annotations

import importlib.util

from enliven.errors import ResourceError


def need(module: str, extra: str, where: str) -> None:
    """Raises ResourceError if a library of an extra is not installed. The message says how to install it."""
    if importlib.util.find_spec(module) is None:
        raise ResourceError(
            f"the library {module!r} is not installed",
            where=where,
            mend=f'Install it: pip install "enliven-edge[{extra}]" '
            f'(from a checkout: pip install "./edge[{extra}]").',
        )
