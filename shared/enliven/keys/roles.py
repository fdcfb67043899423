"""The roles of viewers. Each role includes the rights of the roles before it."""

from __future__ import annotations

from typing import Literal

Role = Literal["watch", "perform", "edit", "operate"]
"""The rights of a viewer on an edge.

"watch": receives streams and characters. "perform": possesses and releases characters. "edit": adds, removes
and resizes characters, and scans. "operate": locks the cast, opens the microphone, and shows pairing codes.
"""
ROLES: tuple[Role, ...] = ("watch", "perform", "edit", "operate")
"""All roles, from the fewest rights to the most."""


def role_includes(role: Role | None, needed: Role | None) -> bool:
    """Returns True if ``role`` includes the rights of ``needed``. None means a viewer without a role."""
    return needed is None or (role is not None and ROLES.index(role) >= ROLES.index(needed))
