"""Creates OpenGL 3.3 core contexts, or raises an error that says what is missing."""

from __future__ import annotations

import sys
from typing import Any

import moderngl

from enliven.errors import ResourceError

GL_VERSION = 330
"""OpenGL 3.3 core in moderngl's notation: the oldest version with instanced drawing, available on every
platform.
"""
INSTALL_HINTS = {
    "linux": "Install OpenGL: apt install libegl1 libgl1 libgl1-mesa-dri",
    "win32": "Install the driver of the graphics card.",
}


def create_offscreen_context() -> moderngl.Context:
    """Returns an offscreen context. It uses EGL on Linux, and the system's own API elsewhere.

    Raises:
        ResourceError: if OpenGL 3.3 is missing.
    """
    options: dict[str, Any] = {"backend": "egl"} if sys.platform.startswith("linux") else {}
    try:
        return moderngl.create_standalone_context(require=GL_VERSION, **options)
    except Exception as error:  # moderngl raises a plain Exception if its loader does not find OpenGL.
        raise _make_missing_error(error) from None


def get_window_context() -> moderngl.Context:
    """Returns the context of this thread's current window.

    Raises:
        ResourceError: if it is older than OpenGL 3.3.
    """
    try:
        return moderngl.create_context(require=GL_VERSION)
    except Exception as error:
        raise _make_missing_error(error) from None


def _make_missing_error(error: Exception) -> ResourceError:
    reason = str(error).strip() or "the driver reports no reason"
    platform = "linux" if sys.platform.startswith("linux") else sys.platform
    return ResourceError(
        f"OpenGL 3.3 is not available ({reason})",
        where="OpenGL",
        remedy=INSTALL_HINTS.get(platform, "Install a graphics driver that supports OpenGL 3.3 core."),
    )
