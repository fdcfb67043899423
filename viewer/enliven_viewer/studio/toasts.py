"""Short-lived messages (toasts): finished commands, errors, and how to fix them."""

from __future__ import annotations

import logging
from dataclasses import dataclass, replace

from enliven.errors import EnlivenError, error_location
from enliven.logs import escape_text
from enliven_viewer.language import tr

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Toast:
    """One message: its text, the advice (or empty), whether it is an error, and the remaining seconds."""

    text: str
    mend: str
    is_error: bool
    remaining_s: float


class Toasts:
    """The messages on the screen, newest last.

    Args:
        seconds: how long a message stays; errors stay twice as long.
    """

    def __init__(self, seconds: float) -> None:
        self._seconds = seconds
        self.shown: tuple[Toast, ...] = ()

    def say(self, text: str, mend: str = "") -> None:
        """Shows a message about something that was done."""
        self._add(Toast(text, mend, False, self._seconds))

    def complain(self, error: EnlivenError) -> None:
        """Shows an error that the artist can fix."""
        message = f"{error.where}: {error.what}" if error.where else error.what
        self._add(Toast(message, error.mend, True, 2 * self._seconds))

    def tell(self, error: BaseException, mend: str = "") -> EnlivenError:
        """Shows any error. Internal errors are shown too, since they must not close the window."""
        if not isinstance(error, EnlivenError):
            log.error("internal error of enliven", exc_info=error)
            message = tr("an internal error of enliven{0}; the log has the details", error_location(error))
            error = EnlivenError(message, mend=mend)
        self.complain(error)
        return error

    def advance(self, seconds: float) -> None:
        """Advances time, and removes expired messages."""
        older = (Toast(t.text, t.mend, t.is_error, t.remaining_s - seconds) for t in self.shown)
        self.shown = tuple(t for t in older if t.remaining_s > 0)

    def _add(self, toast: Toast) -> None:
        toast = replace(toast, text=escape_text(toast.text), mend=escape_text(toast.mend))
        same = (toast.text, toast.mend)
        self.shown = (*(t for t in self.shown if (t.text, t.mend) != same), toast)[-4:]
