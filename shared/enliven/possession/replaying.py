"""Replays a recorded take: passes the recorded bodies and attachments to the same actor as in a live
performance.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from enliven.deformation.graph.graph import DeformationGraph
from enliven.document import BodyTake, Character, HoldChange, Pose, Possession
from enliven.errors import InputError
from enliven.person import Body
from enliven.possession.actor_settings import ActorSettings
from enliven.possession.embedded_actor import EmbeddedActor
from enliven.settings import load_settings

_SAME_TIME_S = 1e-7
"""Maximum difference, seconds, between two equal times. It is far less than one frame of any sensor."""


def settings_from_possession(possession: Possession) -> ActorSettings:
    """Returns the recorded settings of an actor.

    Raises:
        InputError: if the text is not JSON, or contains an unknown setting.
    """
    try:
        values = json.loads(possession.settings)
    except ValueError:
        problem = "the recorded settings are not valid JSON"
        where = f"take {possession.take!r}"
        raise InputError(problem, where=where, remedy="Record the take again.") from None
    where = f"the settings of take {possession.take!r}"
    return load_settings(ActorSettings, values, where=where, own_file=True)


def replay(
    character: Character,
    graph: DeformationGraph,
    take: BodyTake,
    possession: Possession,
    notes: list[str] | None = None,
) -> Iterator[Pose]:
    """Yields the pose of a mesh at each frame of a take, as the stage would show it live.

    The result is deterministic. With the mesh of the recording, the poses equal the recorded poses. A take
    does not contain the performers' surfaces. So a mesh that followed a surface in the live performance is
    driven by the bones alone.

    Args:
        notes: list to which a sentence is appended for each attachment or release that was impossible with
            this mesh.

    Raises:
        InputError: if no performer can attach to the mesh at all.
    """
    settings = replace(settings_from_possession(possession), hand_over=0.0)
    actor = EmbeddedActor(character, graph, settings, possession.size, possession.height or None)
    if possession.place:
        actor.stand(possession.place)
    start, end = possession.start - _SAME_TIME_S, possession.last(take) + _SAME_TIME_S
    frames = np.flatnonzero((take.seconds >= start) & (take.seconds <= end))
    due = sorted(possession.holds, key=lambda change: change.seconds)
    refused, has_held = list[tuple[float, InputError]](), False
    for frame in frames:
        second, bodies = take.seconds[frame], [_with_unknown_joints(body) for body in take.bodies(int(frame))]
        current = [change for change in due if change.seconds <= second + _SAME_TIME_S]
        for change in current:
            if change.mode == "take over":
                _apply_change(actor, change, bodies)
        yield actor.perform(bodies, round(second * 1e9))
        for change in current:
            try:
                if change.mode != "take over":
                    _apply_change(actor, change, bodies)
                    has_held = has_held or bool(actor.holds)
            except InputError as error:
                refused.append((float(second), error))
        due = due[len(current) :]
    if refused and not has_held:
        raise refused[0][1]
    if notes is not None:
        notes.extend(f"At {second:.2f} s: {error.what}." for second, error in refused)


def _apply_change(actor: EmbeddedActor, change: HoldChange, bodies: list[Body]) -> None:
    """Attaches or releases a performer.

    Raises:
        InputError: if no node is within reach, or the performer is not in view.
    """
    if change.mode == "remove":
        return
    if change.mode == "release":
        if change.performer is None or any(hold.body == change.performer for hold in actor.holds):
            actor.release(change.performer)
        return
    body = next((candidate for candidate in bodies if change.performer in (None, candidate.id)), None)
    if body is None:
        performer = "a performer" if change.performer is None else f"performer {change.performer}"
        advice = "Use the take of the performers who possessed the character."
        raise InputError(
            f"{performer} is not in view", where=f"possessing {actor.character.id!r}", remedy=advice
        )
    if change.mode == "take over":
        actor.hand_over(-1 if change.former is None else change.former, body)
    else:
        actor.possess(body, change.parts, change.mode)


def _with_unknown_joints(body: Body) -> Body:
    """Replaces the unknown joints of a recorded body by NaN. A take stores them as the origin with confidence
    0.
    """
    is_known = (body.confidence > 0.0) | body.joints.any(1)
    return body if is_known.all() else replace(body, joints=np.where(is_known[:, None], body.joints, np.nan))
