"""A window with an OpenGL 3.3 core context, by glfw."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, cast

import glfw

from enliven.errors import ResourceError

MEND = "Use --film out.mp4 to render without a window, or start where there is a display."


@contextmanager
def open_window(width: int, height: int, title: str) -> Iterator[Any]:
    """A visible window with its OpenGL context current in this thread; closed on the way out.

    Raises:
        ResourceError: without a display, or without OpenGL 3.3.
    """
    said: list[str] = []
    glfw.set_error_callback(lambda code, text: said.append(error_text(text)))
    if not glfw.init():
        raise ResourceError(_reason(said, "no display was found"), where="window", mend=MEND)
    try:
        hints = (
            (glfw.CONTEXT_VERSION_MAJOR, 3),
            (glfw.CONTEXT_VERSION_MINOR, 3),
            (glfw.OPENGL_PROFILE, glfw.OPENGL_CORE_PROFILE),
            (glfw.OPENGL_FORWARD_COMPAT, glfw.TRUE),
            (glfw.SCALE_TO_MONITOR, glfw.TRUE),
        )
        for hint, value in hints:
            glfw.window_hint(hint, value)
        window = glfw.create_window(width, height, title, None, None)
        if not window:
            raise ResourceError(_reason(said, "no window could be opened"), where="window", mend=MEND)
        glfw.make_context_current(window)
        glfw.swap_interval(1)
        yield window
    finally:
        glfw.terminate()


def _reason(said: list[str], otherwise: str) -> str:
    return said[-1].rstrip(".") if said else otherwise


Place = tuple[int, int, int, int]
"""x, y, width, height of a window."""


def error_text(text: str | bytes) -> str:
    """The text of a message of glfw, which is bytes in some versions."""
    return text.decode(errors="replace") if isinstance(text, bytes) else text


def toggle_full_screen(window: Any, before: Place | None) -> Place | None:
    """Fill the monitor, or go back to ``before``; returns what to go back to, or None."""
    if before is not None:
        glfw.set_window_monitor(window, cast(Any, None), *before, glfw.DONT_CARE)
        return None
    monitor = glfw.get_primary_monitor()
    if not monitor:
        return None
    place = (*glfw.get_window_pos(window), *glfw.get_window_size(window))
    mode = glfw.get_video_mode(monitor)
    glfw.set_window_monitor(window, monitor, 0, 0, mode.size.width, mode.size.height, mode.refresh_rate)
    return place
