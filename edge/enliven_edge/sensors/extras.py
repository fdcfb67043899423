"""The camera libraries, imported when a driver needs them."""

from __future__ import annotations

import importlib
from importlib.metadata import PackageNotFoundError, version
from typing import Any

from enliven.errors import ResourceError
from enliven_edge.sensors.attached_cameras import pip_line, unsupported


def library(module: str, sensor: str, pip: str = "") -> Any:
    """A camera's library.

    Args:
        pip: what pip is to install where no extra of that name can have it.

    Raises:
        ResourceError: where it is not installed, is of a version that does not work, or does not load on
            this machine.
    """
    where, mend = f"sensor {sensor}", pip_line(sensor, pip)
    try:
        why = unsupported(module, version(module))
    except PackageNotFoundError:
        why = ""
    if why:
        raise ResourceError(why, where=where, mend=mend)
    try:
        return importlib.import_module(module)
    except ImportError as error:
        missing = isinstance(error, ModuleNotFoundError) and error.name == module
        what = f"{module} is not installed" if missing else f"{module} does not load ({error})"
        raise ResourceError(what, where=where, mend=mend) from None
