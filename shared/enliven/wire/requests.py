"""The requests of viewers and the edge's replies."""

from __future__ import annotations

from enum import StrEnum
from typing import Annotated, Generic, Literal, TypeVar

from msgspec import Meta, Struct, field
from msgspec.structs import force_setattr

from enliven.keys.roles import Role
from enliven.wire.characters import CharacterMessage
from enliven.wire.fields import (
    MAX_CHARACTERS,
    MAX_LATCHED_MESSAGES,
    MAX_MESSAGE_BYTES,
    MAX_PART_BYTES,
    MAX_UPLOAD_BYTES,
    Count,
    Digest,
    Exaggeration,
    Growth,
    Identity,
    Metres,
    Name,
    Nanoseconds,
    Number,
    Text,
)
from enliven.wire.streams import Revision, StatusMessage

PAIRING_MESSAGE_BYTES = 33
"""Bytes of a SPAKE2 message."""
MAX_BOX_BYTES = 512
"""Maximum bytes of an encrypted box with a key, a name and a role. 150 are usual."""


class Ask(Struct, tag=True, frozen=True):
    """A request of a viewer. Each is a class with an entry in :data:`REQUESTS`."""


class Order(Ask, frozen=True):
    """A request that only the edge's loop can carry out, by a registered handler."""


class Hello(Ask, frozen=True):
    """Introduces a viewer and requests the edge's state.

    ``listening`` is True once the streams have reached the viewer.
    """

    viewer: Name
    listening: bool = False


class GetState(Ask, frozen=True):
    """Requests a character."""

    character: Name


Mode = Literal["alone", "join", "extend", "preview"]
"""Which other performers keep control of a character when one performer possesses it, see :class:`Possess`.
"""


class Possess(Order, frozen=True):
    """Lets a performer possess a character.

    Attributes:
        character: the character's id. None selects the only character, or the free one nearest to the
            performer.
        body: the performer's id. None selects a performer in view, for "join" one that does not control the
            character yet. Performers that control another character are selected last.
        parts: the body parts that control the character: names of :data:`enliven.person.body.PARTS`, joined
            with "+".
        mode: the earlier attachments that are kept. "alone": none (the default of older programs). "join":
            those of other performers, not of this one. "extend": also this performer's earlier parts, except
            bones that are possessed again. "preview": nothing is attached, and the cues show the nodes that
            would be.
    """

    character: Name | None = None
    body: Identity | None = None
    parts: Annotated[str, Meta(min_length=1, max_length=160)] = "all"
    mode: Mode = "alone"


class Release(Order, frozen=True):
    """Releases a character (None: all of the performer's) from a performer (None: from every performer)."""

    character: Name | None = None
    body: Identity | None = None


class Smooth(Order, frozen=True):
    """Sets the smoothing of a performer's joints: 0 for none, None for the value in the settings."""

    body: Identity
    amount: Annotated[float, Meta(ge=0.0, le=20.0)] | None = None


class Lock(Order, frozen=True):
    """Locks or unlocks the cast. While it is locked, people that arrive later stay bystanders."""

    on: bool


class LearnRoom(Order, frozen=True):
    """Learns the background and the floor again, for example after furniture was moved."""


class Look(Order, frozen=True):
    """Reports the viewer's view in the world frame, because poses are matched by their appearance on the
    screen.

    Attributes:
        direction: (3,) from the eye into the scene, not zero.
        up: (3,) the screen's up direction, not parallel to ``direction``.
        eye: (3,) metres, for a perspective view. None for an orthographic one.
    """

    direction: tuple[Number, Number, Number]
    up: tuple[Number, Number, Number]
    eye: tuple[Number, Number, Number] | None = None


class Browse(Order, frozen=True):
    """Selects another match of a character (None: of each rigged character), ``step`` places further in the
    ranking.

    A step of 0 selects the match of the current pose again.
    """

    character: Name | None = None
    step: Annotated[int, Meta(ge=-1000, le=1000)] = 1


class PutCharacter(Order, frozen=True):
    """Puts a character on the stage, or replaces the one with its id, once all its data has arrived.

    The answer is :class:`Done` once the character is on the stage. Until then it is :class:`Awaited`, and the
    request must be repeated. The data is a project file of one character with any rig, without textures.
    :class:`CharacterPart` requests transfer it.

    Attributes:
        id: the character's id on the stage.
        revision: higher than the replaced character's revision. Increment it by one: the edge refuses a
            revision far above the newest one, or above ``MAX_REVISION``.
        digest: SHA-256 of the data. Equal data is sent once.
        size: bytes of the data.
        fit: True scales a possessed mesh to a person's height, and moves it to where a standing person fits
            into it. A mesh from a file is treated in this way. False keeps the modelled size and position, in
            metres.
    """

    id: Name
    revision: Annotated[int, Meta(ge=1, le=2**53)]
    digest: Digest
    size: Annotated[int, Meta(ge=1, le=MAX_UPLOAD_BYTES)]
    fit: bool = False


class CharacterPart(Order, frozen=True):
    """A part of the data of a character that :class:`PutCharacter` announced. Parts must arrive in order."""

    id: Name
    digest: Digest
    offset: Count
    data: Annotated[bytes, Meta(max_length=MAX_PART_BYTES)]


class RemoveCharacter(Order, frozen=True):
    """Removes a character from the stage, and releases its performers."""

    character: Name


class Resize(Order, frozen=True):
    """Changes the size of a character on the stage, or the overshoot of its soft parts. A ``character`` of
    None is the held character, or the next one to be held.

    Attributes:
        do: "hands": the distance between a performer's hands scales the character from now on. This ends if
            the request is repeated, or if the hands keep still. "end": ends the scaling at the current size.
            "set": sets the size. "exaggerate": sets the overshoot of its soft parts.
        body: for "hands", the performer's id. None for the performer that controls the character, or else the
            first in view.
        size: for "set", the factor relative to its original size.
        exaggeration: for "exaggerate", the overshoot. None for the value in the stage's settings.
    """

    do: Literal["hands", "end", "set", "exaggerate"]
    character: Name | None = None
    body: Identity | None = None
    size: Growth = 1.0
    exaggeration: Exaggeration | None = None


class ScanMode(StrEnum):
    """How an object is scanned."""

    AROUND = "around"
    """The camera is carried around the object, which stays in its place."""
    MOVED = "moved"
    """The camera is carried, and the object is turned and put down. All its sides end in one mesh."""
    TURNED = "turned"
    """The object turns on a turntable, and is tracked while it moves. The room is in view."""
    NEAR = "near"
    """The camera stands still and ignores depth beyond a distance. The object is turned in front of it."""
    PERSON = "person"
    """A person in front of a fixed camera turns around once or holds still."""


_MODE_FLAGS = (ScanMode.PERSON, ScanMode.TURNED, ScanMode.MOVED)
"""Modes that viewers without :attr:`Scan.mode` request by the flag of that name; the first one counts."""


class Scan(Order, frozen=True):
    """Controls a scan with the edge's camera.

    Attributes:
        do: "start" a new scan; "pause" it; "go on", also after it was done, which adds to it; "undo" the last
            seconds; "done": the scan becomes a character on the stage; "cancel" the scan.
        name: for "start", the id of the resulting character. None: "scan", or "scan 2", ...
        voxel: for "start", metres, size of a voxel.
        within: for "start" in the mode "near", metres. Depth beyond this distance is ignored.
        whole: for "done", keeps the whole scan, and not only the object on the floor.
        moved, turned, person: the mode for programs that do not know ``mode``. They follow from it.
        box: for "done", keeps the content of a box: six metres on the stage, its lowest and its highest
            corner.
        stage_from_scan: with a box, the pose of the scan on the stage when the box was drawn.
        mode: for "start", how the object is scanned.
    """

    do: Literal["start", "pause", "go on", "undo", "done", "cancel"]
    name: Name | None = None
    voxel: Annotated[float, Meta(ge=0.001, le=0.1)] = 0.004
    within: Metres | None = None
    whole: bool = False
    box: Annotated[list[Number], Meta(max_length=6)] = field(default_factory=list)
    stage_from_scan: Annotated[list[Number], Meta(max_length=12)] = field(default_factory=list)
    moved: bool = False
    turned: bool = False
    person: bool = False
    mode: ScanMode = ScanMode.AROUND

    def __post_init__(self) -> None:
        self._complete_mode()
        if (len(self.box), len(self.stage_from_scan)) not in ((0, 0), (6, 12)):
            raise ValueError("a box has 6 numbers, and 12 of where the scan stood; or none of both")
        if any(low > high for low, high in zip(self.box[:3], self.box[3:], strict=True)):
            raise ValueError("the lowest corner of the box lies above the highest")

    def _complete_mode(self) -> None:
        """Sets ``mode`` from the flags of an older viewer, and the flags for an older edge from ``mode``."""
        requested = {mode for mode in _MODE_FLAGS if getattr(self, mode)}
        if self.within is not None:
            requested.add(ScanMode.NEAR)
        if requested == {ScanMode.TURNED, ScanMode.MOVED}:
            requested = {ScanMode.TURNED}  # An object that turns on a turntable is also moved.
        if self.mode is not ScanMode.AROUND:
            requested.add(self.mode)
        if len(requested) > 1:
            raise ValueError(f"a scan has one mode, not {' and '.join(sorted(requested))}: leave one out")
        mode = next(iter(requested), ScanMode.AROUND)
        if mode is ScanMode.NEAR and self.within is None:
            raise ValueError("the mode near needs a distance: add within, in metres")
        force_setattr(self, "mode", mode)
        if mode in _MODE_FLAGS:
            force_setattr(self, mode, True)


class Listen(Order, frozen=True):
    """Opens or closes the edge's microphone for spoken commands.

    It can be opened from the edge's machine only.
    """

    on: bool


class PlayPhysics(Order, frozen=True):
    """Puts rigid objects on the stage that characters can push. "none" removes them."""

    world: Literal["none", "boxes", "dodgeball"]


class Ping(Ask, frozen=True):
    """Requests the edge's clock, and shows that the viewer is still connected.

    ``sent_ns`` is the viewer's wall clock. A ``probe`` only requests the clock, over its own connection.
    """

    viewer: Name
    sent_ns: Nanoseconds
    listening: bool = False
    probe: bool = False


class StartPairing(Ask, frozen=True):
    """Starts to pair a viewer by the code that the edge shows, see :mod:`enliven.keys.pairing`.

    ``message`` is the viewer's SPAKE2 message. A viewer without keys may send it.
    """

    message: Annotated[bytes, Meta(max_length=PAIRING_MESSAGE_BYTES)]


class FinishPairing(Ask, frozen=True):
    """Sends the viewer's public key, name and requested role, encrypted in a box that only the edge can
    open.
    """

    box: Annotated[bytes, Meta(max_length=MAX_BOX_BYTES)]


class ShowCode(Ask, frozen=True):
    """Requests the pairing code, and accepts pairings for some minutes."""


class Welcome(Struct, tag=True, frozen=True):
    """The answer to :class:`Hello`: the heartbeat, the characters, and the newest message of each latched
    topic and key. ``role`` is the viewer's role, empty from an edge that does not know roles."""

    status: StatusMessage
    characters: Annotated[list[Revision], Meta(max_length=MAX_CHARACTERS)]
    latest: Annotated[
        list[Annotated[bytes, Meta(max_length=MAX_MESSAGE_BYTES)]], Meta(max_length=MAX_LATCHED_MESSAGES)
    ] = field(default_factory=list)
    role: Annotated[str, Meta(max_length=64)] = ""


class Done(Struct, tag=True, frozen=True):
    """The request was carried out."""

    note: Text = ""


class Awaited(Struct, tag=True, frozen=True):
    """The answer while a character is uploaded: the edge has received the first ``received`` bytes. Once it
    has all bytes, it prepares the character.
    """

    received: Count


class Refused(Struct, tag=True, frozen=True):
    """The request was not carried out. ``reason`` contains the reason."""

    reason: Text


class Pong(Struct, tag=True, frozen=True):
    """The edge's wall clock when it answered.

    ``arrived_ns`` is the edge's wall clock when the ping arrived at its computer, or 0 if the system does not
    report it.
    """

    sent_ns: Nanoseconds
    edge_ns: Nanoseconds
    arrived_ns: Nanoseconds = 0


class PairingStarted(Struct, tag=True, frozen=True):
    """The answer to :class:`StartPairing`: the edge's SPAKE2 message."""

    message: Annotated[bytes, Meta(max_length=PAIRING_MESSAGE_BYTES)]


class Paired(Struct, tag=True, frozen=True):
    """The answer to :class:`FinishPairing`: the edge's public key, name and the granted role, in a box."""

    box: Annotated[bytes, Meta(max_length=MAX_BOX_BYTES)]


class ShownCode(Struct, tag=True, frozen=True):
    """The answer to :class:`ShowCode`. The code is empty after too many tries. A new one follows after
    ``seconds``.
    """

    code: Annotated[str, Meta(max_length=16)]
    seconds: Count


SUPERSEDED = "superseded by a newer one"
"""The reason for refusing an order that a newer order of the same viewer has replaced."""
REQUESTS: list[type[Ask]] = [
    *(Hello, GetState, Possess, Release, Smooth, Lock, LearnRoom, Look, Browse, Ping),
    *(PutCharacter, CharacterPart, RemoveCharacter, Scan, Resize),
    *(Listen, PlayPhysics),
    *(StartPairing, FinishPairing, ShowCode),
]
"""All requests that this program reads. A program with another request appends its class."""
NEEDED_ROLES: dict[type[Ask], Role | None] = {
    StartPairing: None,
    FinishPairing: None,
    Hello: "watch",
    GetState: "watch",
    Ping: "watch",
    Possess: "perform",
    Release: "perform",
    Smooth: "perform",
    Look: "perform",
    Browse: "perform",
    PutCharacter: "edit",
    CharacterPart: "edit",
    RemoveCharacter: "edit",
    Resize: "edit",
    Scan: "edit",
    PlayPhysics: "edit",
    Lock: "operate",
    LearnRoom: "operate",
    Listen: "operate",
    ShowCode: "operate",
}
"""The lowest role that may send each request. None: viewers that are not paired may send it, too. A request
that is not listed needs the highest role.
"""
THIS_MACHINE_ONLY: frozenset[type[Ask]] = frozenset({Listen})
"""Requests that only viewers on the edge's own machine may send: others must not open a microphone."""
Answer = Welcome | CharacterMessage | Done | Awaited | Refused | Pong | PairingStarted | Paired | ShownCode
Body = TypeVar("Body")


class Request(Struct, Generic[Body], frozen=True):
    """A viewer's request, one of :data:`REQUESTS`. The reply has the same id."""

    id: Count
    body: Body


class Reply(Struct, frozen=True):
    """The edge's reply to a request."""

    id: Count
    body: Answer
