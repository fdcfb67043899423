"""The requests of viewers and the edge's replies."""

from __future__ import annotations

from typing import Annotated, Generic, Literal, TypeVar

from msgspec import Meta, Struct, field

from enliven.keys import Role
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
"""Maximum bytes of a box with a key, a name and a role: 150 are usual."""


class Ask(Struct, tag=True, frozen=True):
    """A request of a viewer. Each is a class with an entry in :data:`REQUESTS`."""


class Order(Ask, frozen=True):
    """A request that only the edge's loop can carry out, by a registered handler."""


class Hello(Ask, frozen=True):
    """Introduces a viewer and asks for the state.

    ``listening`` is True once the streams have reached the viewer.
    """

    viewer: Name
    listening: bool = False


class GetState(Ask, frozen=True):
    """Asks for a character."""

    character: Name


Mode = Literal["alone", "join", "extend", "preview"]
"""Which other performers keep a character when one possesses it, see :class:`Possess`."""


class Possess(Order, frozen=True):
    """Lets a performer possess a character.

    Attributes:
        character: its id. None: the only one, or of several the free one nearest to the performer.
        body: the performer's id. None: a performer in view, for "join" one that does not hold it yet. With
            several characters, performers that hold another one are avoided.
        parts: the parts that possess, names of :data:`enliven.person.body.PARTS`, joined with "+".
        mode: the holds that are kept. "alone": none, as in programs that do not know this field. "join":
            those of other performers; this performer's earlier parts are released. "extend": as "join", but
            this performer also keeps its earlier parts, except bones that are possessed again. "preview":
            only the cues change. They then show the nodes that this performer would hold.
    """

    character: Name | None = None
    body: Identity | None = None
    parts: Annotated[str, Meta(min_length=1, max_length=160)] = "all"
    mode: Mode = "alone"


class Release(Order, frozen=True):
    """Makes a performer (None: every one) release a character (None: all that the performer holds)."""

    character: Name | None = None
    body: Identity | None = None


class Smooth(Order, frozen=True):
    """Sets the smoothing of a performer's joints. 0: none. None: as in the settings."""

    body: Identity
    amount: Annotated[float, Meta(ge=0.0, le=20.0)] | None = None


class Lock(Order, frozen=True):
    """Locks the cast, so that people that arrive later stay bystanders, or unlocks it."""

    on: bool


class Look(Order, frozen=True):
    """Reports the viewer's view in the world frame: poses are matched as they look on the screen.

    Attributes:
        direction: (3,) from the eye into the scene, not zero.
        up: (3,) the screen's up direction, not parallel to ``direction``.
        eye: (3,) metres, for a perspective view. None for an orthographic one.
    """

    direction: tuple[Number, Number, Number]
    up: tuple[Number, Number, Number]
    eye: tuple[Number, Number, Number] | None = None


class Browse(Order, frozen=True):
    """Shows another match of a character (None: of each rigged character), ``step`` places further in the
    ranking.

    A step of 0 shows the match of the current pose again.
    """

    character: Name | None = None
    step: Annotated[int, Meta(ge=-1000, le=1000)] = 1


class PutCharacter(Order, frozen=True):
    """Puts a character on the stage, or replaces the one with its id, once all its data has arrived.

    The answer is :class:`Done` once it is on the stage, and :class:`Awaited` until then: ask again. The data
    is a project file of one character, of any rig, without textures. It follows in :class:`CharacterPart`.

    Attributes:
        id: its id on the stage.
        revision: higher than that of the replaced character. Count by one: the edge refuses a revision far
            above the newest one, or above ``MAX_REVISION``.
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
    """Removes a character from the stage and frees its performers."""

    character: Name


class Resize(Order, frozen=True):
    """Changes the size of a character on the stage, or the overshoot of its soft parts. A ``character`` of
    None is the held character, or the next one to be held.

    Attributes:
        do: "hands": the distance between a performer's hands scales it from now on. This ends if the request
            is repeated, or if the hands keep still. "end": ends it with the current size. "set": sets the
            size. "exaggerate": sets the overshoot of its soft parts.
        body: for "hands", the performer. None: the holder, or else the first in view.
        size: for "set", the factor of its own size.
        exaggeration: for "exaggerate", the overshoot. None: as in the stage's settings.
    """

    do: Literal["hands", "end", "set", "exaggerate"]
    character: Name | None = None
    body: Identity | None = None
    size: Growth = 1.0
    exaggeration: Exaggeration | None = None


class Scan(Order, frozen=True):
    """Controls a scan with the edge's camera.

    Attributes:
        do: "start" a new scan; "pause" it; "go on", also after it was done, which adds to it; "undo" the last
            seconds; "done": the scan becomes a character on the stage; "cancel" the scan.
        name: for "start", the id of the resulting character. None: "scan", or "scan 2", ...
        voxel: for "start", metres, size of a voxel.
        within: for "start", metres. Depth beyond this distance is ignored. Use it if the object is turned,
            not the camera.
        whole: for "done", keeps the whole scan, and not only the object on the floor.
        moved: for "start", the object is turned and put down during the scan. All its sides end in one mesh.
        turned: for "start", the object turns on a turntable, and is tracked while it moves.
        person: for "start", a person in front of a fixed camera turns around once or holds still.
        box: for "done", keeps the content of a box: six metres on the stage, its lowest and its highest
            corner.
        stage_from_scan: with a box, the pose of the scan on the stage when the box was drawn.
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

    def __post_init__(self) -> None:
        if self.person and (self.moved or self.turned or self.within is not None):
            raise ValueError("a person is scanned alone: leave out moved, turned and within")
        if (self.moved or self.turned) and self.within is not None:
            raise ValueError("an object that is moved needs the floor around it: leave out within, or moved")
        if (len(self.box), len(self.stage_from_scan)) not in ((0, 0), (6, 12)):
            raise ValueError("a box has 6 numbers, and 12 of where the scan stood; or none of both")
        if any(low > high for low, high in zip(self.box[:3], self.box[3:], strict=True)):
            raise ValueError("the lowest corner of the box lies above the highest")


class Listen(Order, frozen=True):
    """Opens or closes the edge's microphone for spoken commands.

    It can be opened from the edge's machine only.
    """

    on: bool


class PlayPhysics(Order, frozen=True):
    """Puts rigid objects on the stage that characters can push. "none" removes them."""

    world: Literal["none", "boxes", "dodgeball"]


class Ping(Ask, frozen=True):
    """Asks for the edge's clock, and shows that the viewer is alive.

    ``sent_ns`` is the viewer's wall clock.
    """

    viewer: Name
    sent_ns: Nanoseconds
    listening: bool = False


class StartPairing(Ask, frozen=True):
    """Begins to pair a viewer by the code that the edge shows, see :mod:`enliven.keys.pairing`.

    ``message`` is the viewer's SPAKE2 message. A viewer without keys may send it.
    """

    message: Annotated[bytes, Meta(max_length=PAIRING_MESSAGE_BYTES)]


class FinishPairing(Ask, frozen=True):
    """Sends the viewer's public key, name and requested role, in a box that only the edge can open."""

    box: Annotated[bytes, Meta(max_length=MAX_BOX_BYTES)]


class ShowCode(Ask, frozen=True):
    """Asks for the pairing code, and accepts pairings for some minutes."""


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
    """The character is being uploaded: the edge has received the first ``received`` bytes. If these are all
    bytes, it prepares the character."""

    received: Count


class Refused(Struct, tag=True, frozen=True):
    """The request was not carried out. ``reason`` contains the reason."""

    reason: Text


class Pong(Struct, tag=True, frozen=True):
    """The edge's wall clock when it answered."""

    sent_ns: Nanoseconds
    edge_ns: Nanoseconds


class PairingStarted(Struct, tag=True, frozen=True):
    """The answer to :class:`StartPairing`: the edge's SPAKE2 message."""

    message: Annotated[bytes, Meta(max_length=PAIRING_MESSAGE_BYTES)]


class Paired(Struct, tag=True, frozen=True):
    """The answer to :class:`FinishPairing`: the edge's public key, name and the granted role, in a box."""

    box: Annotated[bytes, Meta(max_length=MAX_BOX_BYTES)]


class ShownCode(Struct, tag=True, frozen=True):
    """The answer to :class:`ShowCode`. An empty code: too many tries, a new one follows after ``seconds``."""

    code: Annotated[str, Meta(max_length=16)]
    seconds: Count


SUPERSEDED = "superseded by a newer one"
"""The reason for refusing an order that a newer one of the same viewer replaced."""
REQUESTS: list[type[Ask]] = [
    *(Hello, GetState, Possess, Release, Smooth, Lock, Look, Browse, Ping),
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
    Listen: "operate",
    ShowCode: "operate",
}
"""The lowest role that may send a request. None: also viewers that are not paired. A request that is not
listed needs the highest role."""
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
