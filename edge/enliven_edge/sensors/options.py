"""The options of a sensor, as words of a command line say them."""

from __future__ import annotations

from typing import Any

from enliven.errors import InputError


def sensor_options(settings: list[str]) -> dict[str, Any]:
    """KEY=VALUE words as a mapping; numbers and true/false become what they look like.

    Raises:
        InputError: for a word without '='.
    """
    options: dict[str, Any] = {}
    for word in settings:
        key, equals, value = word.partition("=")
        if not equals or not key:
            raise InputError(f"{word!r} is not KEY=VALUE", where="--set", mend="For example: --set speed=2")
        options[key.strip().replace("-", "_")] = _value(value.strip())
    return options


def _value(text: str) -> Any:
    if text.lower() in ("true", "false"):
        return text.lower() == "true"
    for kind in (int, float):
        try:
            return kind(text)
        except ValueError:
            continue
    return text
