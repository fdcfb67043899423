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
    later("the file cannot be written ({0})"),
    later("it cannot be used ({0})"),
    later("the folder {0} does not exist"),
    later("the path exists, but is not a folder"),
    later("the folder contains other files, such as {0}, so it is not replaced"),
    later("the film cannot be written ({0})"),
    later("films need PyAV, which is not installed"),
    later("the installed PyAV contains no film encoder"),
    later("the film encoder {0} is not available on this computer"),
    later("USD files need the package usd-core, which is not installed"),
    later("the page would be larger than {0} MB"),
    later("a recording can contain at most {0} characters, but {1} are selected"),
    later("the character has {0} transforms, but at most {1} can be sent"),
    later("a BVH file can contain only one character, but {0} are selected"),
    later("a VRM file can contain only one character, but {0} are selected"),
    later("a VRM animation can contain only one character, but {0} are selected"),
    later("the character has no skeleton, and a BVH file can contain only skeletons"),
    later("the character is not a humanoid: its joint names do not identify two arms and two legs"),
    later("the character is not a humanoid: its joint names do not identify a head"),
    later("the character is not a humanoid: its spine has no separate joint"),
    later("it has no mesh"),
    later("the character has no mesh"),
    later("no character was selected"),
    later("the scale {0} is not allowed"),
    later("the output loses packets: {0}"),
)
"""Texts of problems. {0} and {1} are placeholders for values."""
_ADVICE = (
    later("Check the folder's permissions and the space on the disk."),
    later("The disk or memory card may be failing. Check it, and copy the readable files to another disk."),
    later(
        "The network drive or device does not answer. Connect it again, or copy the file to this computer."
    ),
    later("Free some space on the disk, or choose a folder on another disk."),
    later("The disk is read-only. Choose a folder on another disk."),
    later("Close other programs, or raise the limit of open files (ulimit -n)."),
    later("Check the permissions of the file or folder."),
    later("Choose another place."),
    later("Choose another output folder."),
    later("Choose another output file."),
    later("Choose another name."),
    later("Did you mean {0}? Create the folder, or check its name."),
    later("Create the folder, or check its name."),
    later('Choose another encoder, or "auto" for the first available encoder.'),
    later("Install PyAV again: pip install av"),
    later('Install the extra: pip install "enliven-edge[film]"'),
    later('Install it: pip install "enliven[usd]" (in a checkout: "./shared[usd]").'),
    later("Choose fewer characters (--character), a shorter range (--end) or a lower --rate."),
    later("Choose fewer characters with --character."),
    later("Choose one with --character NAME."),
    later("Use a coarser deformation graph."),
    later("Export a .glb file instead. It can contain a surface without a skeleton."),
    later("Export a .glb file instead, or use the joint names of Mixamo, VRM or Unreal."),
    later("Export a .glb file instead."),
    later("Add a mesh to the character, or leave the character out."),
    later("Select at least one character."),
    later("Choose a number from {0} to {1}."),
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
    later("no program receives packets at this address"),
    later("the network is too slow for the packets"),
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
            log.error("internal error of enliven", exc_info=error)
            message = tr("an internal error of enliven{0}; the log has the details", error_location(error))
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
