"""Short-lived messages (toasts) about finished commands and errors, with advice."""

from __future__ import annotations

import logging
from dataclasses import dataclass, replace

from enliven.errors import EnlivenError, error_location
from enliven.logs import escape_text
from enliven_viewer.language import tr
from enliven_viewer.studio.error_texts import translate_error

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Toast:
    """One message: its text, the advice or an empty text, an error flag, and the remaining seconds."""

    text: str
    remedy: str
    is_error: bool
    remaining_s: float


class Toasts:
    """The messages on the screen, newest last.

    Args:
        seconds: duration of a message. Errors stay twice as long.
    """

    def __init__(self, seconds: float) -> None:
        self._seconds = seconds
        self.shown: tuple[Toast, ...] = ()

    def say(self, text: str, remedy: str = "") -> None:
        """Shows a message about a finished action."""
        self._add(Toast(text, remedy, False, self._seconds))

    def complain(self, error: EnlivenError) -> None:
        """Shows an error that the artist can fix."""
        translated = translate_error(error)
        message = f"{translated.where}: {translated.what}" if translated.where else translated.what
        self._add(Toast(message, translated.remedy, True, 2 * self._seconds))

    def tell(self, error: BaseException, remedy: str = "") -> EnlivenError:
        """Shows any error. Internal errors are shown too, because they must not close the window."""
        if not isinstance(error, EnlivenError):
            log.error("internal error of enliven", exc_info=error)
            message = tr("an internal error of enliven{0}; the log has the details", error_location(error))
            error = EnlivenError(message, remedy=remedy)
        self.complain(error)
        return error

    def advance(self, seconds: float) -> None:
        """Advances time, and removes expired messages."""
        older = (Toast(t.text, t.remedy, t.is_error, t.remaining_s - seconds) for t in self.shown)
        self.shown = tuple(t for t in older if t.remaining_s > 0)

    def _add(self, toast: Toast) -> None:
        toast = replace(toast, text=escape_text(toast.text), remedy=escape_text(toast.remedy))
        same = (toast.text, toast.remedy)
        self.shown = (*(t for t in self.shown if (t.text, t.remedy) != same), toast)[-4:]
