"""Text from outside, made safe to print: names in files and on the network may hold terminal commands."""

from __future__ import annotations

import re
import unicodedata

_KEPT_CATEGORIES = frozenset({"Zs"})
"""Unicode categories of spaces; they are invisible and move nothing."""
_KEPT = frozenset("\u200c\u200d")
"""Joiners that Persian, Hindi and emoji need; they neither end a line nor change its direction."""
_PLAIN = re.compile(r"[\x20-\x7e]*")


def escaped(text: str) -> str:
    r"""Returns text with every character that is not shown as itself written as ``\x1b`` or ``\u202e``.

    These are control characters, line ends, terminal escapes, marks that change the direction of writing, and
    surrogates. Escaping text again changes nothing.
    """
    if _PLAIN.fullmatch(text):
        return text
    return "".join(letter if _is_shown(letter) else _written(letter) for letter in text)


def _is_shown(letter: str) -> bool:
    """Returns whether a character is shown as itself, on one line."""
    category = unicodedata.category(letter)
    return category[0] not in "CZ" or category in _KEPT_CATEGORIES or letter in _KEPT


def _written(letter: str) -> str:
    """Returns a character as Python writes it in a text."""
    return ascii(letter)[1:-1]
