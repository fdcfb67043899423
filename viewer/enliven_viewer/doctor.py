"""Checks the viewer's requirements: OpenGL, a display, a film encoder."""

from __future__ import annotations

import os
import sys

from enliven.doctor import Check
from enliven.errors import EnlivenError


def run_checks() -> list[Check]:
    """Runs the checks of off-screen OpenGL, the window and the film encoder. Returns their results."""
    return [_check_offscreen(), _check_window(), _check_encoder()]


def has_display() -> bool:
    """Returns True if a window can be opened here."""
    if sys.platform in ("win32", "darwin"):
        return True
    return bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))


def _check_offscreen() -> Check:
    name = "OpenGL off-screen"
    try:
        from enliven_viewer.render.gl.context import create_offscreen_context

        ctx = create_offscreen_context()
    except ImportError as error:
        return Check(name, False, str(error), "Install moderngl: pip install moderngl")
    except EnlivenError as error:
        return Check(name, False, error.what, error.remedy)
    renderer, version = ctx.info["GL_RENDERER"], ctx.version_code
    ctx.release()
    return Check(name, True, f"{renderer}, OpenGL {version // 100}.{version // 10 % 10}")


def _check_window() -> Check:
    """Checks if glfw can connect to the display. A machine without a display can still render films."""
    name = "window"
    if not has_display():
        return Check(name, True, "no display was found, so only films can be rendered: enliven view --film")
    try:
        import glfw

        from enliven_viewer.window import decode_error
    except ImportError as error:
        return Check(name, False, str(error), "Install glfw: pip install glfw")
    errors: list[str] = []
    glfw.set_error_callback(lambda code, text: errors.append(decode_error(text)))
    if not glfw.init():
        return Check(
            name,
            False,
            errors[-1] if errors else "glfw found no display",
            "Check the environment variable DISPLAY, or render films: enliven view --film.",
        )
    version = decode_error(glfw.get_version_string())
    glfw.terminate()
    return Check(name, True, f"display found, glfw {version}")


def _check_encoder() -> Check:
    name = "film encoder"
    try:
        import av

        from enliven.film.encoders import choose_encoder

        encoder = choose_encoder(av)
    except ImportError as error:
        return Check(name, False, str(error), "Install PyAV: pip install av")
    except EnlivenError as error:
        return Check(name, False, error.what, error.remedy)
    description = f"{encoder.name} ({encoder.format}; licence {encoder.licence})"
    if encoder.format != "H.264":
        description = f"no H.264 encoder was found, so films are encoded as {encoder.format}"
        return Check(name, False, description, "Install the PyAV package that contains H.264: pip install av")
    return Check(name, True, description)
