"""The kept state of a stage: its characters and switches, in the format of its file."""

from __future__ import annotations

from typing import Annotated, Literal

import msgspec
from msgspec import Meta

VERSION = 1
"""Version of the files. The edge refuses files of a later version."""
Hex = Annotated[str, Meta(pattern="^([0-9a-f]{64})?$")]
"""SHA-256 of the data of a character, hexadecimal. It is empty for a character from the edge's command line
or settings."""
Finite = Annotated[float, Meta(ge=-1e6, le=1e6)]
"""A number that is not NaN or infinite."""


class KeptCharacter(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A character on the stage.

    Attributes:
        id: its id.
        digest: checksum of its uploaded data; empty for an initial character.
        size: bytes of its uploaded data.
        revision: its revision on the wire.
        fit: as in :class:`enliven.wire.PutCharacter`.
        growth: its display scale.
        exaggeration: the overshoot of its soft parts; None for the value in the settings.
        aside: its offset from the usual waiting place in metres.
    """

    id: Annotated[str, Meta(min_length=1, max_length=64)]
    digest: Hex = ""
    size: Annotated[int, Meta(ge=0)] = 0
    revision: Annotated[int, Meta(ge=1, le=2**53)] = 1
    fit: bool = False
    growth: Annotated[float, Meta(gt=0.0, le=1e3)] = 1.0
    exaggeration: Annotated[float, Meta(ge=0.0, le=1e3)] | None = None
    aside: Finite = 0.0


class StageState(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The kept state of one stage.

    Attributes:
        version: the version of this structure.
        characters: the characters in their order on the stage.
        removed: the initial characters that were removed, by id, with their meshes. A character with another
            mesh and the same id was not removed.
        smoothing: amounts of smoothing by the performer's id; None for the value in the settings.
        locked: the number of performers in the locked cast; None if the cast was not locked.
        initial_world: the physics world that the command line or the settings selected.
        world: the physics world that was active.
    """

    version: int = VERSION
    characters: tuple[KeptCharacter, ...] = ()
    removed: dict[str, str] = {}
    smoothing: dict[str, Annotated[float, Meta(ge=0.0, le=1e3)]] | None = None
    locked: Annotated[int, Meta(ge=0, le=1000)] | None = None
    initial_world: str = "none"
    world: Literal["none", "boxes", "dodgeball"] = "none"


class StartJournal(msgspec.Struct, forbid_unknown_fields=True):
    """The progress of a start. It identifies a character that crashes the edge.

    Attributes:
        current: checksum of the character that is being restored; empty if there is none.
        is_starting: True until the restored characters have run for a while.
        crashes: number of starts that ended while a character was being restored, by its checksum.
    """

    current: Hex = ""
    is_starting: bool = False
    crashes: dict[Hex, Annotated[int, Meta(ge=1)]] = {}
