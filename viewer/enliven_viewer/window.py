"""Functions for the studio's glfw window: full screen, minimised state, and error messages."""

from __future__ import annotations

from typing import Any, cast

import glfw

WindowRectangle = tuple[int, int, int, int]
"""x, y, width and height of a window in screen coordinates."""


def decode_error(text: str | bytes) -> str:
    """Returns the text of a glfw message, which is bytes in some versions."""
    return text.decode(errors="replace") if isinstance(text, bytes) else text


def is_minimised(window: Any) -> bool:
    """Returns True if a window is minimised."""
    return bool(glfw.get_window_attrib(window, glfw.ICONIFIED))


def toggle_full_screen(window: Any, before: WindowRectangle | None) -> WindowRectangle | None:
    """Switches to full screen, or restores the rectangle ``before``. Returns the rectangle to restore later,
    or None after restoring.
    """
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
