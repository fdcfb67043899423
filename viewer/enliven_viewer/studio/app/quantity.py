"""Quantities as artists type them: "50 cm", "1.2 + 0.3", "(2 m - 4 cm) / 2"."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass

from enliven.errors import InputError
from enliven_viewer.language import tr

_TOKEN = re.compile(r"\s*(?:(\d+\.?\d*(?:[eE][+-]?\d+)?|\.\d+)|([^\W\d_]+|[%°])|([-+*/()]))")
"""Matches a number, a unit, or an operator."""
_MAX_LETTERS = 200
"""Maximum number of parsed characters, enough for a sum of a dozen lengths."""


@dataclass(frozen=True)
class Quantity:
    """The type of quantity in a field.

    Attributes:
        unit: unit of numbers without a unit, and of displayed numbers.
        units: the value of each accepted unit, expressed in `unit`.
        digits: number of decimals shown.
    """

    unit: str
    units: Mapping[str, float]
    digits: int

    def format_value(self, value: float) -> str:
        """Returns a value in its displayed form, such as "1.25 m"."""
        shown = f"{value:.{self.digits}f}".rstrip("0").rstrip(".")
        return f"{'0' if shown in ('-0', '') else shown} {self.unit}"

    def parse_value(self, typed: str, **more: float) -> float:
        """Returns the value of the typed text, in :attr:`unit`.

        Args:
            typed: numbers with or without units, + - * / and brackets; a comma counts as a decimal point.
            more: the values of further units; "percent" stands for the sign %.

        Raises:
            InputError: if the text is not a number, or divides by zero.
        """
        units = {**self.units, **{{"percent": "%"}.get(name, name): factor for name, factor in more.items()}}
        reader = _Reader(_split_tokens(typed), {name.lower(): factor for name, factor in units.items()})
        value = reader.sum()
        if reader.remaining_tokens or not math.isfinite(value):
            raise reader.make_error()
        return value


LENGTH = Quantity("m", {"m": 1.0, "cm": 0.01, "mm": 0.001, "km": 1000.0, "in": 0.0254, "ft": 0.3048}, 3)
ANGLE = Quantity("°", {"°": 1.0, "deg": 1.0, "rad": math.degrees(1.0), "turn": 360.0}, 2)
TIME = Quantity("s", {"s": 1.0, "ms": 0.001, "min": 60.0}, 3)
PERCENTAGE = Quantity("%", {"%": 1.0, "x": 100.0}, 1)


def _split_tokens(typed: str) -> list[str]:
    """Returns the numbers, units and operators of a text, in order."""
    text, position, tokens = typed[:_MAX_LETTERS].replace(",", ".").strip(), 0, list[str]()
    while position < len(text):
        match = _TOKEN.match(text, position)
        if match is None:
            return []
        tokens.append(match.group().strip())
        position = match.end()
    return tokens


class _Reader:
    """A parser of tokens as a sum of products of numbers with units."""

    def __init__(self, tokens: list[str], units: Mapping[str, float]) -> None:
        self.remaining_tokens, self._units = tokens[::-1], units

    def sum(self) -> float:
        value = self._read_product()
        while self.remaining_tokens and self.remaining_tokens[-1] in "+-":
            value += self._read_product() if self.remaining_tokens.pop() == "+" else -self._read_product()
        return value

    def _read_product(self) -> float:
        value = self._read_value()
        while self.remaining_tokens and self.remaining_tokens[-1] in "*/":
            times, operand = self.remaining_tokens.pop() == "*", self._read_value()
            if not times and operand == 0.0:
                raise self.make_error(tr("the formula divides by zero"))
            value = value * operand if times else value / operand
        return value

    def _read_value(self) -> float:
        token = self.remaining_tokens.pop() if self.remaining_tokens else ""
        if token in ("-", "+"):
            return self._read_value() if token == "+" else -self._read_value()
        if token == "(":
            value = self.sum()
            if not self.remaining_tokens or self.remaining_tokens.pop() != ")":
                raise self.make_error(tr("a bracket is not closed"))
        elif token[:1].isdecimal() or token[:1] == ".":
            value = float(token)
        else:
            raise self.make_error()
        if self.remaining_tokens and (
            self.remaining_tokens[-1].isalpha() or self.remaining_tokens[-1] in "%°"
        ):
            unit = self.remaining_tokens.pop()
            if unit.lower() not in self._units:
                raise self.make_error(tr("{0} is not a unit of this field", unit))
            value *= self._units[unit.lower()]
        return value

    def make_error(self, problem: str = "") -> InputError:
        unit_names = ", ".join(self._units)
        return InputError(
            problem or tr("the text is not a number"),
            remedy=tr("Type a number or a formula such as 1.2 + 0.3. Units: {0}.", unit_names),
        )
