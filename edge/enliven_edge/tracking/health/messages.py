"""The health messages: sentence, severity and delay for each kind of trouble, in ``messages.toml``."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from importlib.resources import files

from enliven.health import HealthKind, Severity


@dataclass(frozen=True)
class MessageTemplate:
    """The message of one kind of trouble.

    Attributes:
        severity: how grave it is.
        what, mend: what is wrong and what to do, one sentence each, with the facts in braces.
        raise_after, clear_after: seconds of trouble until it is reported, and without until it is over.
    """

    severity: Severity
    what: str
    mend: str
    raise_after: float = 0.5
    clear_after: float = 1.0


def _read() -> dict[HealthKind, MessageTemplate]:
    table = tomllib.loads(files(__package__).joinpath("messages.toml").read_text("utf-8"))
    return {
        HealthKind(kind): MessageTemplate(Severity[said.pop("severity")], **said)
        for kind, said in table.items()
    }


HEALTH_MESSAGES = _read()
"""The message of each kind; a test makes sure that every kind has one."""
