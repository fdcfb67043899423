"""Decides whether a viewer may send a request, by its role and its address. No other module decides this."""

from __future__ import annotations

import ipaddress

from enliven.keys.roles import ROLES, Role, role_includes
from enliven.wire import NEEDED_ROLES, THIS_MACHINE_ONLY, Ask

HOW_TO_PAIR = "Pair this viewer: enliven pair HOST CODE, with the code that the edge shows."
"""Advice for a viewer that is not paired."""


def refusal_reason(kind: type[Ask], role: Role | None, address: str) -> str:
    """Returns why a viewer may not send a request, or an empty string if it may.

    Args:
        kind: the class of the request.
        role: the viewer's role; None if it is not paired.
        address: the viewer's address, without the port.
    """
    needed = NEEDED_ROLES.get(kind, ROLES[-1])
    if not role_includes(role, needed):
        if role is None:
            return f"this edge accepts only paired viewers. {HOW_TO_PAIR}"
        return (
            f"this viewer has the role {role!r}, but the request needs the role {needed!r}. Pair this "
            f"viewer again with --role {needed}."
        )
    if kind in THIS_MACHINE_ONLY and not ipaddress.ip_address(address.partition("%")[0]).is_loopback:
        return "only a viewer on the edge's own computer may send this request"
    return ""
