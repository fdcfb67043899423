"""Converts between the library's data types and network messages, with pure functions."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from enliven.arrays import AnyArray, Float32, Int32
from enliven.document import BALL, BOX, Pose, Props
from enliven.errors import InputError
from enliven.health import HealthState, Severity, sort_by_severity
from enliven.logs import escape_text
from enliven.person import Body
from enliven.person import J as JOINTS
from enliven.wire.fields import MAX_HEALTH, MAX_PROPS, from_bytes, to_bytes
from enliven.wire.posecode import PoseCodec
from enliven.wire.quaternions import pack_quaternions, unpack_quaternions
from enliven.wire.streams import (
    BodiesMessage,
    CuesMessage,
    HealthMessage,
    PackedBody,
    PoseMessage,
    PropsMessage,
)

JOINT_STEP = 2.0**-11
"""Quantization step of a joint, in metres. The error is at most 0.25 mm along each axis (0.43 mm in total),
up to 16 m from the origin."""


def pose_to_message(
    pose: Pose,
    codec: PoseCodec,
    *,
    revision: int,
    instance: int = 0,
    sequence: int = 0,
    captured_ns: int = 0,
    published_ns: int = 0,
) -> PoseMessage:
    """Returns the message of a pose. ``codec`` must belong to the same character and revision.

    Raises:
        InputError: if the numbers of transforms of pose and character differ.
    """
    return PoseMessage(
        pose.character,
        revision,
        instance,
        sequence,
        pose.time_ns,
        captured_ns,
        published_ns,
        codec.encode(pose).data,
    )


def message_to_pose(message: PoseMessage, codec: PoseCodec) -> Pose:
    """Returns the pose of a message, within the errors of :mod:`enliven.wire.quantize`.

    Raises:
        ValueError: if the bytes are not a pose of the codec's character.
    """
    linear, positions = codec.decode(message.transforms)
    return Pose(message.character, message.time_ns, linear, positions)


def bodies_to_message(bodies: Iterable[Body], time_ns: int, captured_ns: int = 0) -> BodiesMessage:
    """Returns the message of bodies. A joint that is not finite becomes the origin with confidence 0."""
    return BodiesMessage(time_ns, captured_ns, [_pack_body(body) for body in bodies])


def round_to_wire(bodies: Iterable[Body]) -> list[Body]:
    """Rounds joints, confidence and stature of bodies to the precision of network messages.

    A stage that gets rounded bodies computes the same result live and from a recording. A joint that is not
    finite stays not finite.
    """
    return [
        replace(
            body,
            joints=np.minimum(np.maximum(np.rint(body.joints / JOINT_STEP), -32768), 32767) * JOINT_STEP,
            confidence=np.rint(np.minimum(np.fmax(body.confidence, 0.0), 1.0) * 255) / 255.0,
            stature=None if body.stature is None else round(body.stature * 1000) / 1000.0,
        )
        for body in bodies
    ]


def _pack_body(body: Body) -> PackedBody:
    finite = np.asarray(np.isfinite(body.joints).all(-1))
    steps = np.rint(np.where(finite[:, None], body.joints, 0.0) / JOINT_STEP)
    confidence = np.nan_to_num(np.where(finite, body.confidence, 0.0))
    stature = 0.0 if body.stature is None else float(np.nan_to_num(body.stature, posinf=0.0))
    return PackedBody(
        int(body.id),
        np.clip(steps, -32768, 32767).astype("<i2").tobytes(),
        _quantise_fractions(confidence),
        b"" if body.orientations is None else pack_quaternions(body.orientations),
        b"" if body.contacts is None else _quantise_fractions(np.nan_to_num(body.contacts)),
        round(min(max(stature, 0.0), 10.0) * 1000),
    )


def _quantise_fractions(values: AnyArray) -> bytes:
    """Encodes numbers in [0, 1] as bytes, with 255 for 1."""
    return bytes(np.rint(np.clip(values, 0, 1) * 255).astype(np.uint8).tobytes())


def message_to_bodies(message: BodiesMessage) -> list[Body]:
    """Decodes the bodies of a message."""
    return [_unpack_body(body) for body in message.bodies]


def _unpack_body(body: PackedBody) -> Body:
    contacts = np.frombuffer(body.contacts, np.uint8) / 255.0
    return Body(
        body.id,
        np.frombuffer(body.joints, "<i2").reshape(JOINTS, 3) * JOINT_STEP,
        np.frombuffer(body.confidence, np.uint8) / 255.0,
        unpack_quaternions(body.orientations) if body.orientations else None,
        contacts if len(contacts) else None,
        body.stature_mm / 1000.0 if body.stature_mm else None,
    )


def health_to_messages(states: Iterable[HealthState]) -> list[HealthMessage]:
    """Returns messages for the most severe health states, at most :data:`MAX_HEALTH`."""
    return [
        HealthMessage(
            str(state.kind)[:64] or "unknown",
            int(state.severity),
            state.since_ns,
            _truncate_sentence(state.what),
            _truncate_sentence(state.remedy),
            state.performer,
        )
        for state in sort_by_severity(list(states))[:MAX_HEALTH]
    ]


def _truncate_sentence(sentence: str) -> str:
    """Truncates a sentence to 160 bytes in UTF-8."""
    return sentence.encode()[:160].decode(errors="ignore")


def messages_to_health(messages: Iterable[HealthMessage]) -> list[HealthState]:
    """Returns the health states of messages, in the order in which they were sent."""
    return [
        HealthState(
            m.kind, Severity(m.severity), m.since_ns, escape_text(m.what), escape_text(m.remedy), m.performer
        )
        for m in messages
    ]


def cues_to_message(
    character: str,
    state: str,
    nodes: AnyArray,
    strengths: AnyArray,
    body: int | None = -1,
    time_ns: int = 0,
    owners: AnyArray | None = None,
    held: int | None = None,
) -> CuesMessage:
    """Returns the message of cues. The state "free" with nodes becomes "preview".

    Args:
        nodes: (K,) node indices.
        strengths: (K,) in [0, 1].
        owners: (K,) the id of the performer who controls each node.
        held: number of attached nodes at the start of ``nodes``. The others are a preview.
    """
    if state not in ("free", "preview", "possessed"):
        raise InputError(
            f"the state {state!r} is unknown", where=f"cues of {character!r}", remedy="Use free or possessed."
        )
    nodes = np.asarray(nodes).astype("<u2")
    strength = np.rint(np.clip(np.nan_to_num(np.asarray(strengths, np.float64)), 0, 1) * 255).astype(np.uint8)
    shown_state = "preview" if state == "free" and len(nodes) else state
    return CuesMessage(
        character,
        shown_state,  # type: ignore[arg-type]
        nodes.tobytes(),
        strength.tobytes(),
        -1 if body is None else int(body),
        time_ns,
        held,
        *_number_owners(owners),
    )


def _number_owners(owners: AnyArray | None) -> tuple[list[int], bytes]:
    """Returns the distinct owners, at most 64, and (K,) the owner of each node.

    If there are more owners, the additional ones are replaced by the last of the 64.
    """
    if owners is None or not len(owners):
        return [], b""
    performers, owner_indices = np.unique(owners, return_inverse=True)
    return performers[:64].astype(int).tolist(), np.minimum(owner_indices, 63).astype(np.uint8).tobytes()


def message_to_owners(message: CuesMessage) -> Int32:
    """Returns the id (K,) of the performer who owns each node."""
    if not message.owners:
        return np.full(len(message.strengths), message.body, np.int32)
    return np.array(message.performers, np.int32)[np.frombuffer(message.owners, np.uint8)]


def message_to_cues(message: CuesMessage) -> tuple[Int32, Float32]:
    """Returns (K,) node indices and (K,) strengths in [0, 1]."""
    nodes = np.frombuffer(message.nodes, "<u2").astype(np.int32)
    return nodes, (np.frombuffer(message.strengths, np.uint8) / 255.0).astype(np.float32)


def props_to_message(props: Props) -> PropsMessage:
    """Returns the message of props.

    Props with a position that is not finite, and props beyond the maximum number, are left out.
    """
    sendable = np.flatnonzero(np.isfinite(props.positions).all(1))[:MAX_PROPS]
    steps = np.rint(props.positions[sendable] / JOINT_STEP)
    millimetres = np.rint(np.nan_to_num(props.sizes[sendable]) * 1000)
    return PropsMessage(
        props.time_ns,
        to_bytes(props.ids[sendable], "<u2"),
        to_bytes(props.shapes[sendable], "u1"),
        to_bytes(np.clip(millimetres, 0, 65535), "<u2"),
        to_bytes(props.colours[sendable], "u1"),
        to_bytes(np.clip(steps, -32768, 32767), "<i2"),
        pack_quaternions(props.turns[sendable]),
        _truncate_sentence(props.note),
    )


def message_to_props(message: PropsMessage) -> Props:
    """Decodes the props of a message.

    Raises:
        InputError: if a prop has an unknown shape.
    """
    shapes = np.frombuffer(message.shapes, np.uint8)
    if not np.isin(shapes, (BOX, BALL)).all():
        raise InputError(
            f"a prop has the unknown shape {int(shapes.max())}", where="props", remedy="Update the viewer."
        )
    return Props(
        message.time_ns,
        np.frombuffer(message.ids, "<u2").astype(np.int64),
        shapes,
        (from_bytes(message.sizes, "<u2", 3) / 1000.0).astype(np.float32),
        from_bytes(message.colours, "u1", 3),
        from_bytes(message.positions, "<i2", 3) * JOINT_STEP,
        unpack_quaternions(message.turns),
        message.note,
    )
