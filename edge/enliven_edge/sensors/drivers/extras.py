"""The camera libraries, imported when a driver needs them."""

from __future__ import annotations

import importlib
from typing import Any

from enliven.errors import ResourceError


def library(module: str, sensor: str, pip: str = "") -> Any:
    """A camera's library.

    Args:
        pip: what pip is to install where no extra of that name can have it.

    Raises:
        ResourceError: where it is not installed, or does not load on this machine.
    """
    try:
        return importlib.import_module(module)
    except ImportError as error:
        missing = isinstance(error, ModuleNotFoundError) and error.name == module
        what = f"{module} is not installed" if missing else f"{module} does not load ({error})"
        mend = f'Type: pip install "enliven-edge[{sensor}]"; in a checkout: pip install "./edge[{sensor}]"'
        mend = f"Type: pip install {pip}" if pip else mend
        raise ResourceError(what, where=f"sensor {sensor}", mend=mend) from None
