"""The requests of viewers and the edge's replies."""

from __future__ import annotations

from typing import Annotated, Generic, Literal, TypeVar

from msgspec import Meta, Struct, field

from enliven.wire.characters import CharacterMessage
from enliven.wire.fields import (
    MAX_CHARACTERS,
    MAX_LATEST,
    MAX_MESSAGE_BYTES,
    MAX_PART_BYTES,
    MAX_SENT_BYTES,
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


class Ask(Struct, tag=True, frozen=True):
    """A request of a viewer; each is a class with a line in :data:`REQUESTS`."""


class Order(Ask, frozen=True):
    """A request that only the edge's loop can carry out, by a handler that it registers."""


class Hello(Ask, frozen=True):
    """Introduces a viewer and asks for the state; ``listening`` once the streams have reached it."""

    viewer: Name
    listening: bool = False


class GetState(Ask, frozen=True):
    """Asks for a character."""

    character: Name


Mode = Literal["alone", "join", "extend", "preview"]
"""Which other performers keep a character when one takes hold, see :class:`Possess`."""


class Possess(Order, frozen=True):
    """A body takes hold of a character.

    Attributes:
        character: its id; None: the only one, of several the free one nearest to the performer.
        body: the performer's id; None: a performer in view, for "join" one that does not hold it yet; of
            several characters none who holds another one, if there is such a performer.
        parts: the parts that take hold, names of :data:`enliven.person.body.PARTS`, joined with "+".
        mode: the other performers that hold it afterwards. "alone": none, as in programs that do not know
            this field. "join": all that did, and this performer lets its earlier parts go. "extend": as
            "join", but this performer also keeps its earlier parts, except bones that take hold anew.
            "preview": nothing changes but the cues, which show from now on what this performer would hold.
    """

    character: Name | None = None
    body: Identity | None = None
    parts: Annotated[str, Meta(min_length=1, max_length=160)] = "all"
    mode: Mode = "alone"


class Release(Order, frozen=True):
    """Makes a performer (None: every one) let a character (None: all that the performer holds) go."""

    character: Name | None = None
    body: Identity | None = None


class Smooth(Order, frozen=True):
    """Sets the smoothing of a performer's joints from now on: 0 none; None: as the settings say."""

    body: Identity
    amount: Annotated[float, Meta(ge=0.0, le=20.0)] | None = None


class Lock(Order, frozen=True):
    """Keeps the cast: people who come later stay bystanders; or ends that."""

    on: bool


class Look(Order, frozen=True):
    """Tells from where the viewer looks, world frame: the meaning of a pose is decided on the screen.

    Attributes:
        direction: (3,) from the eye into the scene, not zero.
        up: (3,) the screen's up, not along it.
        eye: (3,) metres, for a perspective view; None for an orthographic one.
    """

    direction: tuple[Number, Number, Number]
    up: tuple[Number, Number, Number]
    eye: tuple[Number, Number, Number] | None = None


class Browse(Order, frozen=True):
    """Shows another match of a character (None: of each rigged one), so many places on in the ranking; 0
    follows the pose again."""

    character: Name | None = None
    step: Annotated[int, Meta(ge=-1000, le=1000)] = 1


class PutCharacter(Order, frozen=True):
    """Puts a character on the stage, or in the place of the one with its id, once all its data is there.

    The answer is :class:`Done` once it stands there, and until then :class:`Awaited`: ask again. The data is
    a project file of one character, of any rig, without textures; it follows in :class:`CharacterPart`.

    Attributes:
        id: the name that it has on the stage.
        revision: higher than that of the character in the place of which it is put. Count by one: the edge
            refuses a revision far above the newest one, or above ``MAX_REVISION``.
        digest: SHA-256 of the data; equal data is sent once.
        size: bytes of the data.
        fit: whether a possessed mesh is first brought to a person's height, and to where a standing person
            fits into it, as a mesh from a file is; else it stands as modelled, in metres.
    """

    id: Name
    revision: Annotated[int, Meta(ge=1, le=2**53)]
    digest: Digest
    size: Annotated[int, Meta(ge=1, le=MAX_SENT_BYTES)]
    fit: bool = False


class CharacterPart(Order, frozen=True):
    """A part of the data of a character that :class:`PutCharacter` announced; parts come in order."""

    id: Name
    digest: Digest
    offset: Count
    data: Annotated[bytes, Meta(max_length=MAX_PART_BYTES)]


class RemoveCharacter(Order, frozen=True):
    """Takes a character from the stage; performers who held it are free."""

    character: Name


class Resize(Order, frozen=True):
    """Changes the size of a character (None: the one that is held, or would be) on the stage, or its swing.

    Attributes:
        do: "hands": the distance between a performer's hands multiplies its size from now on; asked again,
            or once they keep still, it stays. "end": it stays as it is. "set": it is of this size.
            "exaggerate": its soft parts swing so far past the motion.
        body: for "hands", the performer; None: who holds it, else the first in view.
        size: for "set", how many times its own size.
        exaggeration: for "exaggerate", how far; None: as the stage's settings say.
    """

    do: Literal["hands", "end", "set", "exaggerate"]
    character: Name | None = None
    body: Identity | None = None
    size: Growth = 1.0
    exaggeration: Exaggeration | None = None


class Scan(Order, frozen=True):
    """Scans with the edge's camera: what is to be done now.

    Attributes:
        do: "start" a new scan; "pause" it; "go on", also after it was done, which adds to it; "undo" the last
            seconds; "done": it becomes a character of the stage; "cancel" it.
        name: for "start", the id of the character that it becomes; None: "scan", or "scan 2", ...
        voxel: for "start", metres of a voxel's side.
        within: for "start", metres; what is farther is left out, and the thing may be turned.
        whole: for "done", keep all that was scanned, and not what stands on the floor.
        moved: for "start", the thing is turned and put down meanwhile; all its sides end in one mesh.
        turned: for "start", the thing turns, on a turntable, and is followed while it moves.
        person: for "start", a person before a camera that stands still, who turns once or holds still.
        box: for "done", keep what is in a box: six metres on the stage, its lowest corner and its highest.
        stage_from_scan: with a box, where the scan stood on the stage when the box was drawn.
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
            raise ValueError("a thing that is moved needs the floor about it: leave out within, or moved")
        if (len(self.box), len(self.stage_from_scan)) not in ((0, 0), (6, 12)):
            raise ValueError("a box has 6 numbers, and 12 of where the scan stood; or none of both")
        if any(low > high for low, high in zip(self.box[:3], self.box[3:], strict=True)):
            raise ValueError("the lowest corner of the box lies above the highest")


class Listen(Order, frozen=True):
    """Opens the edge's microphone for spoken commands, or closes it; open it only from the edge's machine."""

    on: bool


class PlayPhysics(Order, frozen=True):
    """Puts loose objects that characters can knock about on the stage; "none" removes them."""

    world: Literal["none", "boxes", "dodgeball"]


class Ping(Ask, frozen=True):
    """Asks for the edge's clock, and says that the viewer is still there; ``sent_ns`` is its wall clock."""

    viewer: Name
    sent_ns: Nanoseconds
    listening: bool = False


class Welcome(Struct, tag=True, frozen=True):
    """The answer to :class:`Hello`: the heartbeat, the characters, and the newest message of each latched
    topic and key."""

    status: StatusMessage
    characters: Annotated[list[Revision], Meta(max_length=MAX_CHARACTERS)]
    latest: Annotated[
        list[Annotated[bytes, Meta(max_length=MAX_MESSAGE_BYTES)]], Meta(max_length=MAX_LATEST)
    ] = field(default_factory=list)


class Done(Struct, tag=True, frozen=True):
    """The request was carried out."""

    note: Text = ""


class Awaited(Struct, tag=True, frozen=True):
    """The character is on its way: the edge has the first ``received`` bytes, or prepares it with all."""

    received: Count


class Refused(Struct, tag=True, frozen=True):
    """The request was not carried out; ``reason`` says why."""

    reason: Text


class Pong(Struct, tag=True, frozen=True):
    """The edge's wall clock when it answered."""

    sent_ns: Nanoseconds
    edge_ns: Nanoseconds


SUPERSEDED = "superseded by a newer one"
"""The reason for refusing an order that a newer one of the same viewer replaced."""
REQUESTS: list[type[Ask]] = [
    *(Hello, GetState, Possess, Release, Smooth, Lock, Look, Browse, Ping),
    *(PutCharacter, CharacterPart, RemoveCharacter, Scan, Resize),
    *(Listen, PlayPhysics),
]
"""All requests that this program reads; a program that reads one more appends its class."""
Answer = Welcome | CharacterMessage | Done | Awaited | Refused | Pong
Body = TypeVar("Body")


class Request(Struct, Generic[Body], frozen=True):
    """A viewer's request, one of :data:`REQUESTS`; the reply carries the same id."""

    id: Count
    body: Body


class Reply(Struct, frozen=True):
    """What the edge answers."""

    id: Count
    body: Answer
