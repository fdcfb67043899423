"""The messages from the edge to every viewer: poses, bodies, cues, props, matches, the heartbeat."""

from __future__ import annotations

from typing import Annotated, Literal

from msgspec import Meta, Struct, field

from enliven.wire.fields import (
    MAX_CHARACTERS,
    MAX_GLANCE,
    MAX_HEALTH,
    MAX_PHRASES,
    MAX_PROPS,
    MAX_SETTINGS,
    MAX_TRANSFORM_BYTES,
    MAX_TRANSFORMS,
    Count,
    Exaggeration,
    Growth,
    Identity,
    Name,
    Nanoseconds,
    Number,
    RevisionNumber,
    Sentence,
    Text,
    expect,
)


class PoseMessage(Struct, array_like=True, frozen=True):
    """The transforms of one character (topic "pose").

    Attributes:
        character: its id.
        revision: of the character that the transforms belong to.
        instance: of the edge's process; a restarted edge has another.
        sequence: counts the poses of this character from 0; a gap is a loss.
        time_ns: the sensor's clock.
        captured_ns: the edge's wall clock when the frame was read.
        published_ns: the edge's wall clock when the pose was sent.
        transforms: bytes of :class:`enliven.wire.posecode.PoseCodec`.
    """

    character: Name
    revision: RevisionNumber
    instance: Count
    sequence: Count
    time_ns: Nanoseconds
    captured_ns: Nanoseconds
    published_ns: Nanoseconds
    transforms: Annotated[bytes, Meta(max_length=MAX_TRANSFORM_BYTES)]


class PackedBody(Struct, array_like=True, frozen=True):
    """One tracked person.

    Attributes:
        id: stable while the person is in view.
        joints: (20, 3) int16 in steps of :data:`enliven.wire.convert.JOINT_STEP` metres, world frame.
        confidence: (20,) uint8, 255 for certain.
        orientations: (20,) uint32 of :mod:`enliven.wire.quaternions`, world_from_bone; empty where unknown.
        contacts: (2,) uint8, 255 where the left and the right foot surely stand; empty where unknown.
        stature_mm: millimetres from soles to crown when standing straight; 0 where unknown.
    """

    id: Identity
    joints: Annotated[bytes, Meta(min_length=120, max_length=120)]
    confidence: Annotated[bytes, Meta(min_length=20, max_length=20)]
    orientations: Annotated[bytes, Meta(max_length=80)] = b""
    contacts: Annotated[bytes, Meta(max_length=2)] = b""
    stature_mm: Annotated[int, Meta(ge=0, le=10_000)] = 0

    def __post_init__(self) -> None:
        if self.orientations:
            expect("orientations", self.orientations, 80)
        if self.contacts:
            expect("contacts", self.contacts, 2)


class BodiesMessage(Struct, array_like=True, frozen=True):
    """All people in view at one moment of the sensor's clock (topic "bodies")."""

    time_ns: Nanoseconds
    captured_ns: Nanoseconds
    bodies: Annotated[list[PackedBody], Meta(max_length=32)]


class CuesMessage(Struct, array_like=True, frozen=True):
    """The nodes to highlight on a character (topic "cues").

    Attributes:
        character: its id.
        state: "free"; "preview": the nodes would be held if the body took hold now; "possessed".
        nodes: (K,) uint16 node indices.
        strengths: (K,) uint8, 255 for the firmest.
        body: the performer's id, the first of several; -1 for none.
        time_ns: the sensor's clock, the time of the poses that it goes with.
        held: so many of the first nodes are held, the others would be by the next performer; None: all of
            them, unless the state is "preview".
        performers: the ids of the performers that own the nodes.
        owners: (K,) uint8 which of the performers holds each node; empty: all are of ``body``.
    """

    character: Name
    state: Literal["free", "preview", "possessed"]
    nodes: Annotated[bytes, Meta(max_length=2 * MAX_TRANSFORMS)] = b""
    strengths: Annotated[bytes, Meta(max_length=MAX_TRANSFORMS)] = b""
    body: Identity = -1
    time_ns: Nanoseconds = 0
    held: Count | None = None
    performers: Annotated[list[Identity], Meta(max_length=64)] = field(default_factory=list)
    owners: Annotated[bytes, Meta(max_length=MAX_TRANSFORMS)] = b""

    def __post_init__(self) -> None:
        expect("nodes", self.nodes, 2 * len(self.strengths))
        if self.owners:
            expect("owners", self.owners, len(self.strengths))
            if max(self.owners) >= len(self.performers):
                raise ValueError(f"an owner is number {max(self.owners)} of {len(self.performers)}")


class HoldMessage(Struct, array_like=True, frozen=True):
    """A performer took hold of a character, or let go (topic "holds").

    Attributes:
        character: its id.
        time_ns: the sensor's clock, of the frame that the change follows; "take over" comes before it.
        mode: what happened; "remove": the character left the stage.
        revision: of the character; 0 where it left.
        body: the performer's id; -1: all of them.
        parts: of the body that took hold.
        former: the id of the performer who held it before, for "take over"; else -1.
        holders: the ids of all who hold it from now on.
        settings: the actor's, as JSON.
        place: where the mesh stood before: scale, radians about +Y, x, y, z in metres; or empty.
        size: metres of the mesh as modelled for one of its rest space.
    """

    character: Name
    time_ns: Nanoseconds
    mode: Literal["alone", "join", "extend", "release", "take over", "remove"]
    revision: RevisionNumber = 0
    body: Identity = -1
    parts: Text = "all"
    former: Identity = -1
    holders: Annotated[list[Identity], Meta(max_length=64)] = field(default_factory=list)
    settings: Annotated[str, Meta(max_length=MAX_SETTINGS)] = "{}"
    place: Annotated[list[Number], Meta(max_length=5)] = field(default_factory=list)
    size: Number = 1.0


class PropsMessage(Struct, array_like=True, frozen=True):
    """All loose things at one moment, so that a late viewer needs no history (topic "props").

    Attributes:
        time_ns: the sensor's clock, the time of the poses that it goes with.
        ids: (P,) uint16, stable while the thing exists.
        shapes: (P,) uint8, 0 a box, 1 a ball.
        sizes: (P, 3) uint16 millimetres: half edges of a box, the radius three times for a ball.
        colours: (P, 3) uint8 sRGB.
        positions: (P, 3) int16 in steps of :data:`enliven.wire.convert.JOINT_STEP` metres, world frame.
        turns: (P,) uint32 of :mod:`enliven.wire.quaternions`, world_from_prop.
        note: one line for people, or empty.
    """

    time_ns: Nanoseconds
    ids: Annotated[bytes, Meta(max_length=2 * MAX_PROPS)]
    shapes: Annotated[bytes, Meta(max_length=MAX_PROPS)]
    sizes: Annotated[bytes, Meta(max_length=6 * MAX_PROPS)]
    colours: Annotated[bytes, Meta(max_length=3 * MAX_PROPS)]
    positions: Annotated[bytes, Meta(max_length=6 * MAX_PROPS)]
    turns: Annotated[bytes, Meta(max_length=4 * MAX_PROPS)]
    note: Sentence = ""

    def __post_init__(self) -> None:
        count = len(self.shapes)
        expect("ids", self.ids, 2 * count)
        expect("sizes", self.sizes, 6 * count)
        expect("colours", self.colours, 3 * count)
        expect("positions", self.positions, 6 * count)
        expect("turns", self.turns, 4 * count)


class PackedMatch(Struct, array_like=True, frozen=True):
    """One match of a source with a character.

    Attributes:
        name: of the joint that the branches begin at.
        place: in the ranking, from 0.
        score: sum of cosines.
        sizes: (m,) uint8, how many joints each branch of the source would drive, the first included.
        points: (sum of sizes, 3) int16 in steps of :data:`enliven.wire.convert.JOINT_STEP` metres, world.
        limbs: (m,) uint8, the performer's limb of each branch; empty: not known, as from an older edge.
        body: the id of the performer of these limbs; -1: not known.
    """

    name: Name
    place: Count
    score: Number
    sizes: Annotated[bytes, Meta(max_length=64)]
    points: Annotated[bytes, Meta(max_length=6 * 1024)]
    limbs: Annotated[bytes, Meta(max_length=64)] = b""
    body: Identity = -1

    def __post_init__(self) -> None:
        expect("points", self.points, 6 * sum(self.sizes))
        if self.limbs:
            expect("limbs", self.limbs, len(self.sizes))


class MatchesMessage(Struct, array_like=True, frozen=True):
    """The possible meanings of a performer's pose on a character (topic "matches").

    Attributes:
        character: its id.
        state: "off": no performer chooses; "choosing"; "playing": the match that is shown drives.
        body: the performer's id; -1 for none.
        time_ns: the sensor's clock.
        shown: which of ``matches`` is meant; -1 for none.
        matches: the best, and the one that is meant.
        total: how many there are.
        held: 0..1, how long of the time to hold still has passed.
    """

    character: Name
    state: Literal["off", "choosing", "playing"]
    body: Identity = -1
    time_ns: Nanoseconds = 0
    shown: Annotated[int, Meta(ge=-1, le=15)] = -1
    matches: Annotated[list[PackedMatch], Meta(max_length=16)] = field(default_factory=list)
    total: Count = 0
    held: Annotated[float, Meta(ge=0.0, le=1.0)] = 0.0

    def __post_init__(self) -> None:
        if self.shown >= len(self.matches):
            raise ValueError(f"match {self.shown} is shown of {len(self.matches)}")


class HealthMessage(Struct, array_like=True, frozen=True):
    """One thing that is wrong at the edge.

    Attributes:
        kind: a word of :class:`enliven.health.HealthKind`, or one that a later program knows.
        severity: 0 to note, 1 the tracking suffers, 2 there is none.
        since_ns: when it began, the sensor's clock.
        what: what is wrong, one sentence.
        mend: what to do about it, one sentence.
        performer: the id of the performer that it is about; -1: it is about the sensor or the whole scene.
    """

    kind: Name
    severity: Annotated[int, Meta(ge=0, le=2)]
    since_ns: Nanoseconds
    what: Sentence
    mend: Sentence = ""
    performer: Identity = -1


class Revision(Struct, array_like=True, frozen=True):
    """A character's id and the revision that the edge holds."""

    character: Name
    revision: RevisionNumber


class StageMessage(Struct, array_like=True, frozen=True):
    """The characters that stand on the stage from a frame on, sent where one came, changed or went (topic
    "stage")."""

    time_ns: Nanoseconds
    characters: Annotated[list[Revision], Meta(max_length=MAX_CHARACTERS)]


class SizeMessage(Struct, array_like=True, frozen=True):
    """How large a character stands on the stage and how far it swings, where that changed (topic "sizes").

    Attributes:
        size: how many times its own size.
        body: the id of the performer who changes it by both hands; -1: it is not being changed.
        exaggeration: how far soft parts swing past the motion; None: as the stage's settings say.
    """

    character: Name
    size: Growth
    body: Identity = -1
    exaggeration: Exaggeration | None = None


class CameraMessage(Struct, array_like=True, frozen=True):
    """Where the edge's camera stands, and a small picture of what it sees (topic "camera").

    Attributes:
        place: world_from_camera, its three upper rows, row by row; the camera looks along +Z, down is +Y.
        lens: focal lengths and principal point (fx, fy, cx, cy), in heights of its image.
        width, height: pixels of the picture; 0 where the sensor tracks people itself and has none.
        nearness: (height * width) bytes, row by row: 255 at the camera, 1 far away, 0 where nothing is known.
    """

    place: Annotated[list[Number], Meta(min_length=12, max_length=12)]
    lens: Annotated[list[Number], Meta(min_length=4, max_length=4)]
    width: Annotated[int, Meta(ge=0, le=MAX_GLANCE)] = 0
    height: Annotated[int, Meta(ge=0, le=MAX_GLANCE)] = 0
    nearness: Annotated[bytes, Meta(max_length=MAX_GLANCE**2)] = b""

    def __post_init__(self) -> None:
        expect("nearness", self.nearness, self.width * self.height)


class CallMessage(Struct, array_like=True, frozen=True):
    """A pedal, button or voice at the edge asks the windows to record (topic "calls").

    Attributes:
        word: "record" begins, or ends what is recorded; "stop" ends it; "again" begins the last one anew.
        control: the name of what asks.
    """

    word: Literal["record", "stop", "again"]
    control: Name


class HeardMessage(Struct, array_like=True, frozen=True):
    """A microphone at the edge heard speech (topic "heard"); silence and noise send nothing.

    Attributes:
        control: the name of the voice control.
        words: the phrase, or the words that were understood of other speech. Empty for other speech at an
            edge that is open to other machines: talk in the room is not sent there.
        understood: whether it is a phrase of the list.
        action: the command that the phrase means; empty if it was not understood.
        refused: why the stage did not carry out the command; empty if it did.
    """

    control: Name
    words: Sentence = ""
    understood: bool = False
    action: Sentence = ""
    refused: Sentence = ""


class VoiceMessage(Struct, array_like=True, frozen=True):
    """The state of the edge's voice control, sent when it changes (topic "voice").

    Attributes:
        state: "off": the microphone is closed; "starting"; "listening"; "missing": it cannot listen.
        what: for "missing", the reason, one sentence.
        mend: what to do about it, one sentence.
        phrases: that it knows.
        actions: the command of each phrase.
    """

    state: Literal["off", "starting", "listening", "missing"]
    what: Sentence = ""
    mend: Sentence = ""
    phrases: Annotated[list[Sentence], Meta(max_length=MAX_PHRASES)] = field(default_factory=list)
    actions: Annotated[list[Sentence], Meta(max_length=MAX_PHRASES)] = field(default_factory=list)

    def __post_init__(self) -> None:
        if len(self.phrases) != len(self.actions):
            raise ValueError(f"there are {len(self.phrases)} phrases and {len(self.actions)} actions")


class PhysicsMessage(Struct, array_like=True, frozen=True):
    """The state of the edge's physics, sent when it changes (topic "physics").

    Attributes:
        world: the loose objects that are on the stage, or being prepared.
        state: "off"; "preparing"; "on"; "missing": the library is not installed; "failed".
        what: for "missing" and "failed", the reason, one sentence.
        mend: what to do about it, one sentence.
    """

    world: Literal["none", "boxes", "dodgeball"]
    state: Literal["off", "preparing", "on", "missing", "failed"]
    what: Sentence = ""
    mend: Sentence = ""


class StatusMessage(Struct, array_like=True, frozen=True):
    """The edge's heartbeat, twice a second (topic "status").

    Attributes:
        edge: the edge's name.
        instance: random for each start of the process.
        revision: of the edge's state; a viewer that sees a new one asks for the state again.
        published_ns: the edge's wall clock.
        sensor: the sensor's identity, or empty.
        phase: the edge's activity, such as "waiting", "watching", "tracking" or "ended".
        note: one sentence for people, or empty.
        fps: poses a second.
        latency_p50_ms: milliseconds from frame read to pose published, the median of late.
        latency_p99_ms: the same, of the slowest in a hundred.
        performers: people in view.
        dropped: frames that came too fast and were passed over, since the start.
        health: what is wrong, the gravest first.
    """

    edge: Name
    instance: Count
    revision: Count
    published_ns: Nanoseconds
    sensor: Annotated[str, Meta(max_length=200)] = ""
    phase: Annotated[str, Meta(max_length=64)] = "waiting"
    note: Text = ""
    fps: Number = 0.0
    latency_p50_ms: Number = 0.0
    latency_p99_ms: Number = 0.0
    performers: Count = 0
    dropped: Count = 0
    health: Annotated[list[HealthMessage], Meta(max_length=MAX_HEALTH)] = field(default_factory=list)
