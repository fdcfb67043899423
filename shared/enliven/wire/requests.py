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
"""Size in bytes of a SPAKE2 message."""
MAX_BOX_BYTES = 512
"""Maximum size in bytes of an encrypted box with a key, a name and a role. 150 bytes are usual."""


class Ask(Struct, tag=True, frozen=True):
    """The base class of all requests of viewers. :data:`REQUESTS` lists its subclasses."""


class Order(Ask, frozen=True):
    """A request that a registered handler executes in the edge's main loop."""


class Hello(Ask, frozen=True):
    """Introduces a viewer and requests the edge's state.

    ``listening`` is True if the viewer has already received stream messages.
    """

    viewer: Name
    listening: bool = False


class GetState(Ask, frozen=True):
    """Requests a character."""

    character: Name


Mode = Literal["alone", "join", "extend", "preview"]
"""The mode of :class:`Possess`: its effect on earlier attachments."""


class Possess(Order, frozen=True):
    """Lets a performer possess a character.

    Attributes:
        character: the character's id. None selects the only character, or the free character nearest to the
            performer.
        body: the performer's id. None selects a performer in view. For "join", the selected performer must
            not control the character yet. Performers who control another character are selected last.
        parts: the body parts that control the character: names of :data:`enliven.person.body.PARTS`, joined
            with "+".
        mode: the effect on earlier attachments. "alone" detaches all performers first (the default of older
            programs). "join" keeps other performers attached. "extend" also keeps this performer's earlier
            attachments, except for bones that attach again. "preview" attaches nothing: the cues show the
            nodes that would be attached.
    """

    character: Name | None = None
    body: Identity | None = None
    parts: Annotated[str, Meta(min_length=1, max_length=160)] = "all"
    mode: Mode = "alone"


class Release(Order, frozen=True):
    """Releases a character from a performer. A ``character`` of None means all characters of the performer,
    and a ``body`` of None means all performers."""

    character: Name | None = None
    body: Identity | None = None


class Smooth(Order, frozen=True):
    """Sets the smoothing of a performer's joints. 0 disables it, and None restores the value in the
    settings."""

    body: Identity
    amount: Annotated[float, Meta(ge=0.0, le=20.0)] | None = None


class Lock(Order, frozen=True):
    """Locks or unlocks the cast (the set of performers). While it is locked, people who arrive later cannot
    become performers."""

    on: bool


class LearnRoom(Order, frozen=True):
    """Makes the edge learn the background and the floor again, for example after furniture was moved."""


class Look(Order, frozen=True):
    """Reports the pose of the viewer's camera in the world frame. It is needed because poses are matched by
    their appearance on the screen.

    Attributes:
        direction: (3,) viewing direction. It must not be zero.
        up: (3,) the screen's up direction. It must not be parallel to ``direction``.
        eye: (3,) metres, position of a perspective camera. None for an orthographic camera.
    """

    direction: tuple[Number, Number, Number]
    up: tuple[Number, Number, Number]
    eye: tuple[Number, Number, Number] | None = None


class Browse(Order, frozen=True):
    """Selects the match that is ``step`` ranks lower in the list of pose matches. A ``character`` of None
    means all rigged characters.

    A step of 0 selects the best match of the current pose again.
    """

    character: Name | None = None
    step: Annotated[int, Meta(ge=-1000, le=1000)] = 1


class PutCharacter(Order, frozen=True):
    """Adds a character to the stage, or replaces the character with the same id, as soon as all its data has
    arrived.

    The answer is :class:`Awaited` until the character is on the stage, and the request must be repeated until
    the answer is :class:`Done`. The data is a project file with one character with any rig, without textures.
    It is transferred by :class:`CharacterPart` requests.

    Attributes:
        id: the character's id on the stage.
        revision: revision number of the character. To replace a character, increment its revision by one. The
            edge refuses numbers that are much larger, or above ``MAX_REVISION``.
        digest: SHA-256 of the data. Data that the edge already has is not sent again.
        size: size of the data in bytes.
        fit: True scales a mesh for possession to a person's height, and moves it so that a standing person
            fits into it, as for a mesh from a file. False keeps the modelled size and position, in metres.
    """

    id: Name
    revision: Annotated[int, Meta(ge=1, le=2**53)]
    digest: Digest
    size: Annotated[int, Meta(ge=1, le=MAX_UPLOAD_BYTES)]
    fit: bool = False


class CharacterPart(Order, frozen=True):
    """Uploads a part of the data of a character that :class:`PutCharacter` announced. Parts must arrive in
    order."""

    id: Name
    digest: Digest
    offset: Count
    data: Annotated[bytes, Meta(max_length=MAX_PART_BYTES)]


class RemoveCharacter(Order, frozen=True):
    """Removes a character from the stage, and releases its performers."""

    character: Name


class Resize(Order, frozen=True):
    """Changes the size of a character on the stage, or the overshoot of its soft parts. A ``character`` of
    None means the character that is possessed, or that would be possessed next.

    Attributes:
        do: the action. "hands": from now on, the distance between a performer's hands scales the character,
            until the request is repeated or the hands keep still. "end": ends the scaling at the current
            size. "set": sets the size. "exaggerate": sets the overshoot of its soft parts.
        body: for "hands", the performer's id. None means the performer who controls the character, or else
            the first performer in view.
        size: for "set", the factor relative to its original size.
        exaggeration: for "exaggerate", the factor on the overshoot. None means the value in the stage's
            settings.
    """

    do: Literal["hands", "end", "set", "exaggerate"]
    character: Name | None = None
    body: Identity | None = None
    size: Growth = 1.0
    exaggeration: Exaggeration | None = None


class ScanMode(StrEnum):
    """The method of scanning: motion of the camera and of the object."""

    AROUND = "around"
    """The camera is carried around the object, which stays in its place."""
    MOVED = "moved"
    """The camera is carried, and the object is repeatedly turned and put down. The scans of all sides are
    merged to one mesh."""
    TURNED = "turned"
    """The object rotates on a turntable and is tracked. The camera also sees the room."""
    NEAR = "near"
    """The camera is fixed and ignores depth beyond a distance. The object is turned in front of it."""
    PERSON = "person"
    """A person in front of a fixed camera turns around once or holds still."""


_MODE_FLAGS = (ScanMode.PERSON, ScanMode.TURNED, ScanMode.MOVED)
"""Modes that older viewers, which do not know :attr:`Scan.mode`, request by a flag. The first mode in this
order with a set flag is used."""


class Scan(Order, frozen=True):
    """Controls a scan with the edge's camera.

    Attributes:
        do: the action. "start" starts a new scan, "pause" pauses it, and "go on" continues it, even after
            "done". "undo" removes the last seconds. "done" converts the scan to a character on the stage.
            "cancel" discards the scan.
        name: for "start", the id of the resulting character. None means "scan", or "scan 2", ... if that id
            is used.
        voxel: for "start", size of a voxel in metres.
        within: for "start" in the mode "near", maximum depth in metres. Depth beyond it is ignored.
        whole: for "done", True keeps the whole scan. False keeps only the object on the floor.
        moved, turned, person: flags that are set from ``mode``, for programs that do not know ``mode``.
        box: for "done", a box. Its content is kept. Its lowest and its highest corner are six coordinates in
            metres on the stage.
        stage_from_scan: if a box is given, the pose of the scan on the stage when the box was drawn.
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
            raise ValueError("box must contain 6 numbers and stage_from_scan 12, or both must be empty")
        if any(low > high for low, high in zip(self.box[:3], self.box[3:], strict=True)):
            raise ValueError(
                "a coordinate of the box's lowest corner is larger than that of the highest corner"
            )

    def _complete_mode(self) -> None:
        """Sets ``mode`` from the flags of an older viewer, and the flags for an older edge from ``mode``."""
        requested = {mode for mode in _MODE_FLAGS if getattr(self, mode)}
        if self.within is not None:
            requested.add(ScanMode.NEAR)
        if requested == {ScanMode.TURNED, ScanMode.MOVED}:
            requested = {ScanMode.TURNED}  # Older viewers set both flags for a turntable.
        if self.mode is not ScanMode.AROUND:
            requested.add(self.mode)
        if len(requested) > 1:
            raise ValueError(
                f"a scan can have only one mode, but {' and '.join(sorted(requested))} are requested"
            )
        mode = next(iter(requested), ScanMode.AROUND)
        if mode is ScanMode.NEAR and self.within is None:
            raise ValueError("the scan mode near needs a maximum distance: set within, in metres")
        force_setattr(self, "mode", mode)
        if mode in _MODE_FLAGS:
            force_setattr(self, mode, True)


class Listen(Order, frozen=True):
    """Opens or closes the edge's microphone for spoken commands.

    Only a viewer on the edge's machine can open it.
    """

    on: bool


class PlayPhysics(Order, frozen=True):
    """Adds rigid objects that characters can push to the stage. "none" removes them."""

    world: Literal["none", "boxes", "dodgeball"]


class Ping(Ask, frozen=True):
    """Requests the edge's clock, and keeps the connection alive.

    ``sent_ns`` is the time of the viewer's wall clock. A ``probe`` only requests the clock, over a separate
    connection.
    """

    viewer: Name
    sent_ns: Nanoseconds
    listening: bool = False
    probe: bool = False


class StartPairing(Ask, frozen=True):
    """Starts the pairing of a viewer by the code that the edge displays, see :mod:`enliven.keys.pairing`.

    ``message`` is the viewer's SPAKE2 message. A viewer without keys may send it.
    """

    message: Annotated[bytes, Meta(max_length=PAIRING_MESSAGE_BYTES)]


class FinishPairing(Ask, frozen=True):
    """Completes the pairing. Sends the viewer's public key, name and requested role, encrypted so that only
    the edge can read them.
    """

    box: Annotated[bytes, Meta(max_length=MAX_BOX_BYTES)]


class ShowCode(Ask, frozen=True):
    """Requests the pairing code. The edge then accepts pairings for some minutes."""


class Welcome(Struct, tag=True, frozen=True):
    """The answer to :class:`Hello`: the heartbeat, the characters, and the newest message of each latched
    topic and key. ``role`` is the viewer's role. It is empty if the edge does not know roles."""

    status: StatusMessage
    characters: Annotated[list[Revision], Meta(max_length=MAX_CHARACTERS)]
    latest: Annotated[
        list[Annotated[bytes, Meta(max_length=MAX_MESSAGE_BYTES)]], Meta(max_length=MAX_LATCHED_MESSAGES)
    ] = field(default_factory=list)
    role: Annotated[str, Meta(max_length=64)] = ""


class Done(Struct, tag=True, frozen=True):
    """The answer to a request that was executed."""

    note: Text = ""


class Awaited(Struct, tag=True, frozen=True):
    """The answer while a character is uploaded. The edge has received the first ``received`` bytes. When it
    has all bytes, it prepares the character.
    """

    received: Count


class Refused(Struct, tag=True, frozen=True):
    """The answer to a request that was not executed. ``reason`` contains the reason."""

    reason: Text


class Pong(Struct, tag=True, frozen=True):
    """The answer to :class:`Ping`: the edge's wall clock at the time of the answer.

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
    """The answer to :class:`FinishPairing`: the edge's public key, name and the granted role, encrypted."""

    box: Annotated[bytes, Meta(max_length=MAX_BOX_BYTES)]


class ShownCode(Struct, tag=True, frozen=True):
    """The answer to :class:`ShowCode`. The code is empty after too many tries. Then a new code is available
    after ``seconds``.
    """

    code: Annotated[str, Meta(max_length=16)]
    seconds: Count


SUPERSEDED = "superseded by a newer one"
"""The reason in :class:`Refused` for an order that a newer order of the same viewer has replaced."""
REQUESTS: list[type[Ask]] = [
    *(Hello, GetState, Possess, Release, Smooth, Lock, LearnRoom, Look, Browse, Ping),
    *(PutCharacter, CharacterPart, RemoveCharacter, Scan, Resize),
    *(Listen, PlayPhysics),
    *(StartPairing, FinishPairing, ShowCode),
]
"""All requests that this program can read. A program that defines another request must append its class."""
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
"""The minimum role for each request. None means that unpaired viewers may send it. A request that is not
listed requires the highest role.
"""
THIS_MACHINE_ONLY: frozenset[type[Ask]] = frozenset({Listen})
"""Requests that only viewers on the edge's own machine may send. Other viewers must not open a microphone."""
Answer = Welcome | CharacterMessage | Done | Awaited | Refused | Pong | PairingStarted | Paired | ShownCode
Body = TypeVar("Body")


class Request(Struct, Generic[Body], frozen=True):
    """The envelope of a viewer's request. The body is one of :data:`REQUESTS`. The reply has the same id."""

    id: Count
    body: Body


class Reply(Struct, frozen=True):
    """The envelope of the edge's reply to a request."""

    id: Count
    body: Answer
