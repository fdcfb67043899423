"""The messages from the edge to all viewers, such as poses, bodies, cues, props, matches and the
heartbeat."""

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
        sequence: sequence number of the pose of this character, from 0. A gap means that poses were lost.
        time_ns: time of the pose, nanoseconds of the sensor's clock.
        captured_ns: time at which the frame was read, nanoseconds of the edge's wall clock.
        published_ns: time at which the pose was sent, nanoseconds of the edge's wall clock.
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
        id: the person's id, which does not change while the person is in view.
        joints: (20, 3) int16 in steps of :data:`enliven.wire.convert.JOINT_STEP` metres, world frame.
        confidence: (20,) uint8, 255 for certain.
        orientations: (20,) uint32 rotations from bone to world, encoded by :mod:`enliven.wire.quaternions`.
            Empty if unknown.
        contacts: (2,) uint8 confidence that the left and the right foot stand, 255 for certain. Empty if
            unknown.
        stature_mm: height from soles to crown when standing straight, millimetres. 0 if unknown.
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
        state: "free", "preview" or "possessed". "preview" shows the nodes to which the body would attach if
            it possessed the character now.
        nodes: (K,) uint16 node indices.
        strengths: (K,) uint8, 255 for the strongest attachment.
        body: the performer's id, or the first of several. -1 for none.
        time_ns: the sensor's clock, the time of the matching poses.
        held: number of attached nodes, which come first. The next performer would attach to the others. None
            means that all are attached, unless the state is "preview".
        performers: the ids of the performers who control the nodes.
        owners: (K,) uint8 index in ``performers`` of the performer who controls each node. Empty means that
            ``body`` controls all nodes.
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
                raise ValueError(
                    f"a node has the owner number {max(self.owners)}, but there are only "
                    f"{len(self.performers)} performers"
                )


class HoldMessage(Struct, array_like=True, frozen=True):
    """An event: a performer possessed or released a character (topic "holds").

    Attributes:
        character: its id.
        time_ns: time of the frame before the change, nanoseconds of the sensor's clock. A "take over" already
            applies to this frame.
        mode: the kind of change, see :class:`enliven.document.body_take.HoldChange`. "remove" means that the
            character left the stage.
        revision: revision of the character, or 0 if it left the stage.
        body: the performer's id, or -1 for all performers.
        parts: the body parts that control the character.
        former: for "take over", the id of the performer who was attached before. Otherwise -1.
        holders: the ids of all attached performers after the change.
        settings: the actor's settings, as JSON.
        place: placement of the mesh before the change: scale, radians about +Y, x, y, z in metres. Empty if
            unknown.
        size: scale: metres of the modelled mesh per metre of its rest space.
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
    """All props at one time (topic "props"). Each message is complete, so a viewer that connects late needs
    no history.

    Attributes:
        time_ns: the sensor's clock, the time of the matching poses.
        ids: (P,) uint16 ids, which do not change while the prop exists.
        shapes: (P,) uint8, 0 for a box, 1 for a ball.
        sizes: (P, 3) uint16 millimetres: the half edge lengths of a box, or the radius of a ball in all three
            columns.
        colours: (P, 3) uint8 sRGB.
        positions: (P, 3) int16 in steps of :data:`enliven.wire.convert.JOINT_STEP` metres, world frame.
        turns: (P,) uint32 rotations from prop to world, encoded by :mod:`enliven.wire.quaternions`.
        note: one line of text for users, or empty.
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
    """One match of a performer's limbs with branches of a character's skeleton.

    Attributes:
        name: name of the character's joint at which the branches start.
        place: rank of the match, from 0.
        score: sum of cosines between the branches' bones and the performer's.
        sizes: (m,) uint8, number of joints in each branch that would be driven, including the first joint.
        points: (sum of sizes, 3) int16 positions of these joints, in steps of
            :data:`enliven.wire.convert.JOINT_STEP` metres, world frame.
        limbs: (m,) uint8, the performer's limb that drives each branch. Empty if unknown (older edges).
        body: the id of the performer, or -1 if unknown.
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
        state: "off", "choosing" or "playing". In "off", no performer chooses a match. In "playing", the shown
            match drives the character.
        body: the performer's id, or -1 for none.
        time_ns: the sensor's clock.
        shown: index of the shown match in ``matches``, or -1 for none.
        matches: the best matches, and the shown one.
        total: total number of matches.
        held: elapsed fraction, 0 to 1, of the time for which the performer must hold still.
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
            raise ValueError(f"match {self.shown} is shown, but there are only {len(self.matches)}")


class HealthMessage(Struct, array_like=True, frozen=True):
    """One problem at the edge.

    Attributes:
        kind: a value of :class:`enliven.health.HealthKind`. A later program may send an unknown value.
        severity: 0 for a note, 1 if tracking is impaired, 2 if tracking fails.
        since_ns: start of the problem, nanoseconds of the sensor's clock.
        what: one sentence about the problem.
        remedy: the remedy, one sentence.
        performer: the id of the affected performer, or -1 if the problem affects the sensor or the whole
            scene.
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
        size: factor relative to the character's original size.
        body: the id of the performer who changes the size with both hands, or -1.
        exaggeration: factor on the overshoot of soft parts. None means the value in the stage's settings.
    """

    character: Name
    size: Growth
    body: Identity = -1
    exaggeration: Exaggeration | None = None


class CameraMessage(Struct, array_like=True, frozen=True):
    """The camera preview: the pose of the edge's camera, and a small depth image (topic "camera").

    Attributes:
        place: transform from camera to world: its upper three rows, row by row. The camera looks along +Z,
            and +Y is down.
        lens: focal lengths and principal point (fx, fy, cx, cy), as fractions of its image height.
        width, height: size of the image in pixels. 0 if the sensor tracks people itself and delivers no
            image.
        nearness: (height * width) bytes, row by row. 255 is at the camera, 1 is far away, and 0 is unknown.
    """

    place: Annotated[list[Number], Meta(min_length=12, max_length=12)]
    lens: Annotated[list[Number], Meta(min_length=4, max_length=4)]
    width: Annotated[int, Meta(ge=0, le=MAX_PREVIEW_PIXELS)] = 0
    height: Annotated[int, Meta(ge=0, le=MAX_PREVIEW_PIXELS)] = 0
    nearness: Annotated[bytes, Meta(max_length=MAX_PREVIEW_PIXELS**2)] = b""

    def __post_init__(self) -> None:
        check_length("nearness", self.nearness, self.width * self.height)


class CallMessage(Struct, array_like=True, frozen=True):
    """A recording command for all windows from a pedal, button or voice control at the edge (topic "calls").

    Attributes:
        word: "record" starts or ends a recording, "stop" ends it, and "again" repeats the last recording.
        control: the name of the control.
    """

    word: Literal["record", "stop", "again"]
    control: Name


class HeardMessage(Struct, array_like=True, frozen=True):
    """Speech that a microphone at the edge received (topic "heard"). Nothing is sent for silence and noise.

    Attributes:
        control: the name of the voice control.
        words: the recognised phrase, or the words of other speech. If other machines can reach the edge,
            other speech is left out (empty), because it may be private.
        understood: True if the speech is one of the known phrases.
        action: the command of the phrase. Empty if the speech was not understood.
        refused: the reason why the stage did not execute the command. Empty if it was executed.
    """

    control: Name
    words: Sentence = ""
    understood: bool = False
    action: Sentence = ""
    refused: Sentence = ""


class VoiceMessage(Struct, array_like=True, frozen=True):
    """The state of the edge's voice control, sent when it changes (topic "voice").

    Attributes:
        state: "off" (the microphone is closed), "starting", "listening" or "missing" (it cannot listen).
        what: for "missing", one sentence about the reason.
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
        world: the kind of rigid objects that are on the stage or being prepared.
        state: "off", "preparing", "on", "missing" (the library is not installed) or "failed".
        what: for "missing" and "failed", one sentence about the reason.
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
        sensor: identifier of the sensor, or empty.
        phase: the edge's activity, such as "waiting", "watching", "tracking" or "ended".
        note: one sentence for users, or empty.
        fps: number of poses per second.
        latency_p50_ms: recent median of the latency from reading a frame to sending its poses, milliseconds.
        latency_p99_ms: recent 99th percentile of this latency, milliseconds.
        performers: number of people in view.
        dropped: number of frames since the start that arrived too fast and were dropped.
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
