"""Limits the number of characters on a stage, in total and for each viewer."""

from __future__ import annotations

import ipaddress
from collections.abc import Callable, Collection, Iterable
from dataclasses import dataclass
from typing import Protocol

from enliven.errors import InputError
from enliven.settings import setting


class Peer(Protocol):
    """A viewer that puts characters on the stage. It is identified by its connection and its address.

    Attributes:
        address: the address of its machine, without the port.
    """

    address: str

    @property
    def is_open(self) -> bool:
        """Returns True if the viewer is still connected."""


@dataclass(frozen=True)
class StageSettings:
    """Limits of the number of characters on the stage, and the folder in which the stage is saved."""

    characters: int = setting(
        16,
        "Maximum number of characters on the stage, counting those from viewers. Each additional "
        "character lowers the frame rate.",
        low=1,
        high=256,
    )
    per_viewer: int = setting(
        12, "Maximum number of characters that one viewer may put on the stage.", low=1, high=256
    )
    keep: str = setting(
        "",
        "Folder in which the stage is saved, so that it is restored after a restart. A path is relative to "
        "this file. If empty, the folder of the systemd unit ($STATE_DIRECTORY), or none.",
    )


PendingCharacters = Iterable[tuple[str, Peer | None]]
"""Characters that are being uploaded: the id of each, and the viewer that sends it."""


class StageCapacity:
    """Counts the characters on a stage and the characters that are being uploaded, in total and for each
    viewer.

    Viewers on other machines are distinguished by address. Viewers on this machine share one address, so they
    are distinguished by connection. Characters of closed connections count for every viewer with the same
    address.

    Args:
        standing: the ids of the characters that are on the stage. The stage updates this collection.
    """

    def __init__(self, settings: StageSettings, standing: Collection[str]) -> None:
        self._settings, self._standing = settings, standing
        self._owners: dict[str, Peer] = {}
        self._sources: list[Callable[[], PendingCharacters]] = []

    def watch(self, coming: Callable[[], PendingCharacters]) -> None:
        """Registers a function that returns characters that are being uploaded."""
        self._sources.append(coming)

    def set_owner(self, character: str, owner: Peer | None) -> None:
        """Stores the viewer that put a character on the stage. ``owner`` is None for the edge itself."""
        self.forget(character)
        if owner is not None:
            self._owners[character] = owner

    def forget(self, character: str) -> None:
        """Deletes the owner of a character that left the stage."""
        self._owners.pop(character, None)

    def check(self, character: str, peer: Peer | None) -> None:
        """Checks that one more character fits on the stage. A character that is already on it is always
        allowed.

        Raises:
            InputError: if the stage is full, or the viewer has too many characters on it.
        """
        coming = dict(entry for source in self._sources for entry in source())
        if character in self._standing or character in coming:
            return
        where, count = f"character {character!r}", len(set(self._standing) | coming.keys())
        if count >= self._settings.characters:
            remedy = "Remove a character first, or raise characters under [stage] in the edge's settings."
            raise InputError(
                f"the stage is full, because it has {count} characters", where=where, remedy=remedy
            )
        if peer is None:
            return
        owners = [self._owners.get(name) for name in self._standing] + list(coming.values())
        viewer_count = sum(owner is not None and _counts_for(owner, peer) for owner in owners)
        if viewer_count >= self._settings.per_viewer:
            remedy = "Remove a character first, or raise per_viewer under [stage] in the edge's settings."
            raise InputError(
                f"this viewer already has {viewer_count} characters on the stage", where=where, remedy=remedy
            )


def _counts_for(owner: Peer, peer: Peer) -> bool:
    """Returns True if a character of ``owner`` counts towards the limit of ``peer``."""
    if owner is peer:
        return True
    return owner.address == peer.address and not (owner.is_open and _is_loopback(owner.address))


def _is_loopback(address: str) -> bool:
    """Returns True if an address belongs to this machine."""
    try:
        return ipaddress.ip_address(address.partition("%")[0]).is_loopback
    except ValueError:
        return False
