"""Short-lived messages (toasts): finished commands, errors, and how to fix them.

The library's errors are in English. Only those of exports and live outputs are translated here.
"""

from __future__ import annotations

import logging
import re
from collections.abc import Iterator
from dataclasses import dataclass, replace

from enliven.errors import EnlivenError, error_location
from enliven.logs import escape_text
from enliven_viewer.language import LazyText, later, tr

_PROBLEMS = (
    later("it cannot be written ({0})"),
    later("it cannot be used ({0})"),
    later("the folder {0} does not exist"),
    later("it exists and is not a folder"),
    later("the folder contains other files, such as {0}, and is not replaced"),
    later("the film cannot be written ({0})"),
    later("films need PyAV, which is not installed"),
    later("PyAV has no film encoder"),
    later("the film encoder {0} cannot be used here"),
    later("USD files need the package usd-core, which is not installed"),
    later("the page would have more than {0} MB"),
    later("a recording holds at most {0} characters, not {1}"),
    later("it has {0} transforms, at most {1} go on the wire"),
    later("a BVH file holds one character, not {0}"),
    later("a VRM file holds one character, not {0}"),
    later("a VRM animation holds one character, not {0}"),
    later("it has no skeleton, and a BVH file holds nothing else"),
    later("it is not a humanoid: no two arms and two legs are found by the names of its joints"),
    later("it is not a humanoid: no joint is named head"),
    later("it is not a humanoid: its spine has no joint of its own"),
    later("it has no mesh"),
    later("there is nothing to write"),
    later("{0} is not a scale"),
    later("the output loses packets: {0}"),
)
"""Texts of problems. {0} and {1} are placeholders for values."""
_ADVICE = (
    later("Check the folder's permissions and the space on the disk."),
    later("Its card or disk may be failing: check it, and copy what can still be read to another one."),
    later("Its network drive or device does not answer: connect it again, or copy the file to this machine."),
    later("Make room on the disk, or choose a folder on another one."),
    later("The disk can only be read: choose a folder on another one."),
    later("Close other programs, or raise the limit of open files (ulimit -n)."),
    later("Check its permissions."),
    later("Choose another place."),
    later("Choose another name."),
    later("Did you mean {0}? Make it, or check its name."),
    later("Make it, or check its name."),
    later('Choose another one, or "auto" for the first that can.'),
    later("Install it again: pip install av"),
    later('Install the extra: pip install "enliven-edge[film]"'),
    later('Install it: pip install "enliven[usd]" (in a checkout: "./shared[usd]").'),
    later("Choose fewer characters (--character), a shorter range (--end) or a lower --rate."),
    later("Choose some of them with --character."),
    later("Choose one: --character NAME."),
    later("Use a coarser deformation graph."),
    later("Write a .glb instead: its joints carry any surface."),
    later("Write a .glb instead, or name the joints as Mixamo, VRM or Unreal do."),
    later("Write a .glb instead."),
    later("Give it one, or leave it out."),
    later("Give a character."),
    later("Give a number from {0} to {1}."),
    later("Start the receiving program, and compare its address and port with the output's."),
)
"""Texts of advice."""
_REASONS = (
    later("No space left on device"),
    later("Disk quota exceeded"),
    later("Permission denied"),
    later("Operation not permitted"),
    later("Read-only file system"),
    later("Is a directory"),
    later("Not a directory"),
    later("No such file or directory"),
    later("Input/output error"),
    later("File name too long"),
    later("File too large"),
    later("Too many open files"),
    later("Text file busy"),
    later("no program listens there"),
    later("the network takes fewer packets than are sent"),
)
"""Reasons that the operating system and the network give."""
_PLACES = (later("character {0}"),)
"""Texts for the location of errors that are not in a file."""


def translate_error(error: EnlivenError) -> EnlivenError:
    """Returns an error with its texts in the language in use, if they are known."""
    texts = (_translate(error.where), _translate(error.remedy))
    return EnlivenError(_translate(error.what), where=texts[0], remedy=texts[1])


def list_known_texts() -> Iterator[LazyText]:
    """Yields all texts that can be translated."""
    yield from (*_PROBLEMS, *_ADVICE, *_REASONS, *_PLACES)


def find_pattern(text: str) -> tuple[LazyText, tuple[str, ...]] | None:
    """Returns the known text that an English text matches, and the inserted values. Returns None if it
    matches no known text.
    """
    if text in _PLAIN_TEXTS:
        return _PLAIN_TEXTS[text], ()
    for expression, pattern in _EXPRESSIONS:
        match = expression.fullmatch(text)
        if match is not None:
            return pattern, match.groups()
    return None


def _translate(text: str) -> str:
    match = find_pattern(text)
    if match is None:
        return text
    message, values = match
    return tr(message.pattern, *(_translate(value) for value in values))


def _compile_pattern(pattern: str) -> re.Pattern[str]:
    """Returns a regular expression that matches a text with values. Each placeholder must occur once, in
    order.
    """
    return re.compile("(.+)".join(map(re.escape, re.split(r"\{\d\}", pattern))), re.DOTALL)


_PLAIN_TEXTS = {text.pattern: text for text in list_known_texts() if "{" not in text.pattern}
_EXPRESSIONS = [(_compile_pattern(text.pattern), text) for text in list_known_texts() if "{" in text.pattern]


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

    def show_message(self, text: str, remedy: str = "") -> None:
        """Shows a message about a finished action."""
        self._add(Toast(text, remedy, False, self._seconds))

    def show_error(self, error: EnlivenError) -> None:
        """Shows an error that the artist can fix."""
        translated = translate_error(error)
        message = f"{translated.where}: {translated.what}" if translated.where else translated.what
        self._add(Toast(message, translated.remedy, True, 2 * self._seconds))

    def show_any_error(self, error: BaseException, remedy: str = "") -> EnlivenError:
        """Shows any error. Internal errors are shown too, because they must not close the window."""
        if not isinstance(error, EnlivenError):
            log.error("internal error in enliven", exc_info=error)
            message = tr(
                "enliven has an internal error{0}; the log contains the details", error_location(error)
            )
            error = EnlivenError(message, remedy=remedy)
        self.show_error(error)
        return error

    def advance(self, seconds: float) -> None:
        """Advances time, and removes expired messages."""
        older = (Toast(t.text, t.remedy, t.is_error, t.remaining_s - seconds) for t in self.shown)
        self.shown = tuple(t for t in older if t.remaining_s > 0)

    def _add(self, toast: Toast) -> None:
        toast = replace(toast, text=escape_text(toast.text), remedy=escape_text(toast.remedy))
        same = (toast.text, toast.remedy)
        self.shown = (*(t for t in self.shown if (t.text, t.remedy) != same), toast)[-4:]
