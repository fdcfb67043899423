"""The messages from the edge to every viewer: poses, bodies, cues, props, matches, the heartbeat."""

from __future__ import annotations

from typing import Annotated, Literal

from msgspec import Meta, Struct, field

from enliven.wire.fields import (
    MAX_CHARACTERS,
    MAX_HEALTH,
    MAX_PHRASES,
    MAX_PREVIEW_PIXELS,
    MAX_PROPS,
    MAX_SETTINGS_LENGTH,
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
    check_length,
)


class PoseMessage(Struct, array_like=True, frozen=True):
    """The transforms of one character (topic "pose").

    Attributes:
        character: the character's id.
        revision: revision of the character that the transforms belong to.
        instance: random number of the edge's process. A restarted edge has a different one.
        sequence: counts the poses of this character from 0. A gap is a loss.
        time_ns: time of the pose by the sensor's clock.
        captured_ns: the edge's wall clock when the frame was read.
        published_ns: the edge's wall clock when the pose was sent.
        transforms: the pose, encoded by :class:`enliven.wire.posecode.PoseCodec`.
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
        orientations: (20,) uint32 of :mod:`enliven.wire.quaternions`, world_from_bone. Empty if unknown.
        contacts: (2,) uint8, 255 if the left or the right foot certainly stands. Empty if unknown.
        stature_mm: millimetres from soles to crown when standing straight. 0 if unknown.
    """

    id: Identity
    joints: Annotated[bytes, Meta(min_length=120, max_length=120)]
    confidence: Annotated[bytes, Meta(min_length=20, max_length=20)]
    orientations: Annotated[bytes, Meta(max_length=80)] = b""
    contacts: Annotated[bytes, Meta(max_length=2)] = b""
    stature_mm: Annotated[int, Meta(ge=0, le=10_000)] = 0

    def __post_init__(self) -> None:
        if self.orientations:
            check_length("orientations", self.orientations, 80)
        if self.contacts:
            check_length("contacts", self.contacts, 2)


class BodiesMessage(Struct, array_like=True, frozen=True):
    """All people in view at one moment of the sensor's clock (topic "bodies")."""

    time_ns: Nanoseconds
    captured_ns: Nanoseconds
    bodies: Annotated[list[PackedBody], Meta(max_length=32)]


class CuesMessage(Struct, array_like=True, frozen=True):
    """The nodes to highlight on a character (topic "cues").

    Attributes:
        character: the character's id.
        state: "free"; "preview": the nodes that would attach to the body if it possessed the character now;
            "possessed".
        nodes: (K,) uint16 node indices.
        strengths: (K,) uint8, 255 for the strongest attachment.
        body: the performer's id, the first of several. -1 for none.
        time_ns: the sensor's clock, the time of the matching poses.
        held: number of attached nodes, which come first. The next performer would attach to the others. None:
            all are attached, unless the state is "preview".
        performers: the ids of the performers that control the nodes.
        owners: (K,) uint8 index of the performer that controls each node. Empty: ``body`` controls all.
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
        check_length("nodes", self.nodes, 2 * len(self.strengths))
        if self.owners:
            check_length("owners", self.owners, len(self.strengths))
            if max(self.owners) >= len(self.performers):
                raise ValueError(f"an owner is number {max(self.owners)} of {len(self.performers)}")


class HoldMessage(Struct, array_like=True, frozen=True):
    """A performer possessed or released a character (topic "holds").

    Attributes:
        character: its id.
        time_ns: the sensor's clock at the frame before the change. A "take over" already applies to that
            frame.
        mode: the kind of change. "remove": the character left the stage.
        revision: revision of the character. 0 if it left.
        body: the performer's id, or -1 for all performers.
        parts: the body parts that control the character.
        former: the id of the previous holder, for "take over". Otherwise -1.
        holders: the ids of all holders after the change.
        settings: the actor's settings, as JSON.
        place: placement of the mesh before the change: scale, radians about +Y, x, y, z in metres; or empty.
        size: metres of the modelled mesh per metre of its rest space.
    """

    character: Name
    time_ns: Nanoseconds
    mode: Literal["alone", "join", "extend", "release", "take over", "remove"]
    revision: RevisionNumber = 0
    body: Identity = -1
    parts: Text = "all"
    former: Identity = -1
    holders: Annotated[list[Identity], Meta(max_length=64)] = field(default_factory=list)
    settings: Annotated[str, Meta(max_length=MAX_SETTINGS_LENGTH)] = "{}"
    place: Annotated[list[Number], Meta(max_length=5)] = field(default_factory=list)
    size: Number = 1.0


class PropsMessage(Struct, array_like=True, frozen=True):
    """All props at one moment, so that a late viewer needs no history (topic "props").

    Attributes:
        time_ns: the sensor's clock, the time of the matching poses.
        ids: (P,) uint16, stable while the prop exists.
        shapes: (P,) uint8, 0 a box, 1 a ball.
        sizes: (P, 3) uint16 millimetres: half edges of a box; for a ball the radius, three times.
        colours: (P, 3) uint8 sRGB.
        positions: (P, 3) int16 in steps of :data:`enliven.wire.convert.JOINT_STEP` metres, world frame.
        turns: (P,) uint32 of :mod:`enliven.wire.quaternions`, world_from_prop.
        note: one line for users, or empty.
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
        check_length("ids", self.ids, 2 * count)
        check_length("sizes", self.sizes, 6 * count)
        check_length("colours", self.colours, 3 * count)
        check_length("positions", self.positions, 6 * count)
        check_length("turns", self.turns, 4 * count)


class PackedMatch(Struct, array_like=True, frozen=True):
    """One match of a source with a character.

    Attributes:
        name: name of the joint at the start of the branches.
        place: rank of the match, from 0.
        score: sum of cosines between the branches' bones and the performer's.
        sizes: (m,) uint8, number of joints that each branch of the source would drive, including the first.
        points: (sum of sizes, 3) int16 in steps of :data:`enliven.wire.convert.JOINT_STEP` metres, world.
        limbs: (m,) uint8, the performer's limb of each branch. Empty if unknown (older edges).
        body: the id of the performer of these limbs. -1 if unknown.
    """

    name: Name
    place: Count
    score: Number
    sizes: Annotated[bytes, Meta(max_length=64)]
    points: Annotated[bytes, Meta(max_length=6 * 1024)]
    limbs: Annotated[bytes, Meta(max_length=64)] = b""
    body: Identity = -1

    def __post_init__(self) -> None:
        check_length("points", self.points, 6 * sum(self.sizes))
        if self.limbs:
            check_length("limbs", self.limbs, len(self.sizes))


class MatchesMessage(Struct, array_like=True, frozen=True):
    """The candidate matches of a performer's pose with a character (topic "matches").

    Attributes:
        character: its id.
        state: "off": no performer chooses; "choosing"; "playing": the shown match drives the character.
        body: the performer's id. -1 for none.
        time_ns: the sensor's clock.
        shown: index of the shown match in ``matches``. -1 for none.
        matches: the best matches, and the shown one.
        total: total number of matches.
        held: 0..1, elapsed fraction of the time for which the performer must hold still.
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
    """One problem at the edge.

    Attributes:
        kind: a word of :class:`enliven.health.HealthKind`, or an unknown word of a later program.
        severity: 0 a note, 1 tracking is impaired, 2 tracking fails.
        since_ns: when the problem started, by the sensor's clock.
        what: the problem, one sentence.
        remedy: the remedy, one sentence.
        performer: the id of the affected performer. -1 if it affects the sensor or the whole scene.
    """

    kind: Name
    severity: Annotated[int, Meta(ge=0, le=2)]
    since_ns: Nanoseconds
    what: Sentence
    remedy: Sentence = ""
    performer: Identity = -1


class Revision(Struct, array_like=True, frozen=True):
    """A character's id, and the revision that the edge has."""

    character: Name
    revision: RevisionNumber


class StageMessage(Struct, array_like=True, frozen=True):
    """The characters on the stage, sent when a character was added, changed or removed (topic "stage")."""

    time_ns: Nanoseconds
    characters: Annotated[list[Revision], Meta(max_length=MAX_CHARACTERS)]


class SizeMessage(Struct, array_like=True, frozen=True):
    """The size of a character on the stage and the overshoot of its soft parts, sent when they change (topic
    "sizes").

    Attributes:
        size: factor relative to its original size.
        body: the id of the performer that changes it by both hands. -1 if no performer changes it.
        exaggeration: overshoot of soft parts. None for the value in the stage's settings.
    """

    character: Name
    size: Growth
    body: Identity = -1
    exaggeration: Exaggeration | None = None


class CameraMessage(Struct, array_like=True, frozen=True):
    """The camera preview: the pose of the edge's camera, and a small depth image (topic "camera").

    Attributes:
        place: world_from_camera, its upper three rows, row by row. The camera looks along +Z, down is +Y.
        lens: focal lengths and principal point (fx, fy, cx, cy), as fractions of its image height.
        width, height: pixels of the image. 0 if the sensor tracks people itself and delivers no image.
        nearness: (height * width) bytes, row by row: 255 at the camera, 1 far away, 0 unknown.
    """

    place: Annotated[list[Number], Meta(min_length=12, max_length=12)]
    lens: Annotated[list[Number], Meta(min_length=4, max_length=4)]
    width: Annotated[int, Meta(ge=0, le=MAX_PREVIEW_PIXELS)] = 0
    height: Annotated[int, Meta(ge=0, le=MAX_PREVIEW_PIXELS)] = 0
    nearness: Annotated[bytes, Meta(max_length=MAX_PREVIEW_PIXELS**2)] = b""

    def __post_init__(self) -> None:
        check_length("nearness", self.nearness, self.width * self.height)


class CallMessage(Struct, array_like=True, frozen=True):
    """A pedal, button or voice control at the edge requests that windows record (topic "calls").

    Attributes:
        word: "record" starts or ends a recording; "stop" ends it; "again" starts the last one again.
        control: the name of the control.
    """

    word: Literal["record", "stop", "again"]
    control: Name


class HeardMessage(Struct, array_like=True, frozen=True):
    """A microphone at the edge received speech (topic "heard"). Silence and noise send nothing.

    Attributes:
        control: the name of the voice control.
        words: the phrase, or the recognised words of other speech. An edge that other machines can reach
            leaves out other speech (empty), because it may be private.
        understood: True if it is a phrase of the list.
        action: the command of the phrase. Empty if it was not understood.
        refused: the reason why the stage did not carry out the command. Empty if it did.
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
        remedy: the remedy, one sentence.
        phrases: the known phrases.
        actions: the command of each phrase.
    """

    state: Literal["off", "starting", "listening", "missing"]
    what: Sentence = ""
    remedy: Sentence = ""
    phrases: Annotated[list[Sentence], Meta(max_length=MAX_PHRASES)] = field(default_factory=list)
    actions: Annotated[list[Sentence], Meta(max_length=MAX_PHRASES)] = field(default_factory=list)

    def __post_init__(self) -> None:
        if len(self.phrases) != len(self.actions):
            raise ValueError(f"there are {len(self.phrases)} phrases and {len(self.actions)} actions")


class PhysicsMessage(Struct, array_like=True, frozen=True):
    """The state of the edge's physics, sent when it changes (topic "physics").

    Attributes:
        world: the kind of rigid objects on the stage, or being prepared.
        state: "off"; "preparing"; "on"; "missing": the library is not installed; "failed".
        what: for "missing" and "failed", the reason, one sentence.
        remedy: the remedy, one sentence.
    """

    world: Literal["none", "boxes", "dodgeball"]
    state: Literal["off", "preparing", "on", "missing", "failed"]
    what: Sentence = ""
    remedy: Sentence = ""


class StatusMessage(Struct, array_like=True, frozen=True):
    """The edge's heartbeat, twice per second (topic "status").

    Attributes:
        edge: the edge's name.
        instance: random number for each start of the process.
        revision: revision of the edge's state. A viewer that receives a new revision requests the state
            again.
        published_ns: the edge's wall clock.
        sensor: the sensor's identity, or empty.
        phase: the edge's activity, such as "waiting", "watching", "tracking" or "ended".
        note: one sentence for users, or empty.
        fps: poses per second.
        latency_p50_ms: milliseconds from frame read to pose published, the recent median.
        latency_p99_ms: the same, the 99th percentile.
        performers: number of people in view.
        dropped: number of frames that came too fast and were dropped, since the start.
        health: the current problems, the most severe first.
        pairing_s: seconds until the shown pairing code expires, or 0 if pairing is closed. The code itself is
            not in the heartbeat, because viewers that may only watch receive it, too.
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
    pairing_s: Count = 0
