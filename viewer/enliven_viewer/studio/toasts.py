"""Short messages that stay a while: what was done, and what to do about what went wrong."""

from __future__ import annotations

import logging
from dataclasses import dataclass, replace

from enliven.errors import EnlivenError, place_of
from enliven.logs import escaped
from enliven_viewer.language import tr

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Toast:
    """One message: its text, what to do about it (or empty), whether it is bad, seconds that it stays."""

    text: str
    mend: str
    bad: bool
    left: float


class Toasts:
    """The messages on the screen, the newest last.

    Args:
        seconds: how long one stays; what is bad stays twice as long.
    """

    def __init__(self, seconds: float) -> None:
        self._seconds = seconds
        self.shown: tuple[Toast, ...] = ()

    def say(self, text: str, mend: str = "") -> None:
        """Tells of something that was done."""
        self._add(Toast(text, mend, False, self._seconds))

    def complain(self, error: EnlivenError) -> None:
        """Tells of something that could not be done."""
        what = f"{error.where}: {error.what}" if error.where else error.what
        self._add(Toast(what, error.mend, True, 2 * self._seconds))

    def tell(self, error: BaseException, mend: str = "") -> EnlivenError:
        """Tells of anything that went wrong: a fault of our own too, since the window must not end by it."""
        if not isinstance(error, EnlivenError):
            log.error("a fault of enliven itself", exc_info=error)
            what = tr("a fault of enliven itself{0}; the log says more", place_of(error))
            error = EnlivenError(what, mend=mend)
        self.complain(error)
        return error

    def advance(self, seconds: float) -> None:
        """Lets time pass."""
        older = (Toast(t.text, t.mend, t.bad, t.left - seconds) for t in self.shown)
        self.shown = tuple(t for t in older if t.left > 0)

    def _add(self, toast: Toast) -> None:
        toast = replace(toast, text=escaped(toast.text), mend=escaped(toast.mend))
        same = (toast.text, toast.mend)
        self.shown = (*(t for t in self.shown if (t.text, t.mend) != same), toast)[-4:]
