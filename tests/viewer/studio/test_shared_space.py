"""Tests of several edges in one space over real sockets: poses, equal names, a common time, and a lost
edge.
"""

from __future__ import annotations

import contextlib
import time
import uuid
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from patience import wait_until

from enliven.document.character import Character, SkinWeights
from enliven.person import Body
from enliven.space.rigid_transform import compose_transform, rotation_from_vector
from enliven.space.space_file import Place, Space, convert_to_nested_tuples
from enliven.wire import bodies_to_message
from enliven_edge.network.publisher import Publisher
from enliven_viewer.live.followed_edge import find_shared_performer_id
from enliven_viewer.live.shared_space import SharedSpace
from enliven_viewer.studio.editor.editor import Editor
from enliven_viewer.studio.features.perform.session import PerformSession

MS = 1_000_000


def make_character(name: str = "chair", count: int = 8) -> Character:
    pivots = np.random.default_rng(count).normal(size=(count, 3)).astype(np.float32)
    skin = SkinWeights(np.zeros((count, 4), np.uint16), np.full((count, 4), 0.25, np.float32))
    return Character(name, pivots, np.array([[0, 1, 2]], np.int32), skin, pivots, np.zeros((0, 2), np.int32))


class MovingEdge:
    """An edge with its own sensor clock, whose character moves 1 m per second along x.

    Args:
        delay_ms: milliseconds from a frame to its publication.
    """

    def __init__(self, name: str, delay_ms: float = 0.0) -> None:
        self.publisher = Publisher(name=name, pose_port=0, control_port=0)
        self.character = make_character()
        self.publisher.set_character(self.character)
        self._delay_ns = round(delay_ms * MS)
        self._start_ns, self._next_ns = time.time_ns(), time.time_ns()
        self._waiting: list[int] = []
        self.stopped = False

    @property
    def address(self) -> str:
        return str(self.publisher.endpoint)

    def place_at(self, wall_ns: int) -> float:
        """Returns the character's position along x in metres, at a time of the wall clock."""
        return (wall_ns - ORIGIN_NS) * 1e-9

    def poll(self) -> None:
        if self.stopped:
            return
        self.publisher.poll()
        now = time.time_ns()
        if now >= self._next_ns:
            self._next_ns = now + 33 * MS
            self._waiting.append(now)
        while self._waiting and self._waiting[0] + self._delay_ns <= now:
            captured = self._waiting.pop(0)
            sensor_ns = captured - self._start_ns
            rest = self.character.rest_pose()
            moved = rest.positions + np.array([self.place_at(captured), 0, 0], np.float32)
            self.publisher.publish_pose(replace(rest, time_ns=sensor_ns, positions=moved), captured)
            joints = np.tile([self.place_at(captured), 1.0, 0.0], (20, 1))
            body = Body(1, joints, np.ones(20))
            self.publisher.publish(bodies_to_message([body], sensor_ns, captured))

    def stop(self) -> None:
        if not self.stopped:
            self.stopped = True
            self.publisher.close()


ORIGIN_NS = time.time_ns()
"""Time of the wall clock at which all characters are at x = 0."""


def until(session: PerformSession, done: Callable[[], Any], *edges: MovingEdge) -> None:
    """Runs the session and the edges until a condition holds."""

    def step() -> None:
        for edge in edges:
            edge.poll()
        session.advance(0.01)

    wait_until(done, step=step, interval=0.004)


@pytest.fixture
def session(tmp_path: Path) -> Iterator[PerformSession]:
    opened = PerformSession(Editor(), tmp_path)
    opened.active_workspace = "Perform"
    yield opened
    opened.disconnect()


def follow(session: PerformSession, *edges: MovingEdge) -> None:
    for edge in edges:
        session.add_secondary(edge.address)


def shown_places(session: PerformSession, rest: Character) -> list[float]:
    """Returns each character's displacement along x in metres, in the order of the edges."""
    assert session.scene is not None
    start = rest.rest_pose().positions[0, 0]
    return [float(actor.pose.positions[0, 0] - start) for actor in session.scene.actors]


def is_aligned(session: PerformSession) -> bool:
    """Returns True if the clocks of all edges are known and all characters are shown."""
    clients = [session._client, *(guest.client for guest in session.secondary_edges)]
    probes = [client.edges[0].probe for client in clients if client is not None]
    are_known = all(probe is not None and probe.is_known for probe in probes)
    return are_known and session.scene is not None and len(session.scene.actors) == len(clients)


@pytest.mark.slow
def test_frames_of_both_edges_are_drawn_at_the_same_moment(session: PerformSession) -> None:
    """The characters move alike, so at the same time they are at the same position."""
    fast, slow = MovingEdge(uuid.uuid4().hex), MovingEdge(uuid.uuid4().hex, delay_ms=90.0)
    with contextlib.ExitStack() as stack:
        stack.callback(fast.stop)
        stack.callback(slow.stop)
        follow(session, fast, slow)
        until(session, lambda: is_aligned(session), fast, slow)
        worst = []
        end = time.monotonic() + 1.5
        while time.monotonic() < end:
            until(session, lambda: True, fast, slow)
            for edge in (fast, slow):
                edge.poll()
            session.advance(0.01)
            lags = [session.live.playhead.lag_ns, session.secondary_edges[0].live.playhead.lag_ns]
            a, b = shown_places(session, fast.character)
            if max(lags):
                worst.append(abs(a - b))
            time.sleep(0.004)
        assert len(worst) > 20, "the fast edge waits for the slow one"
        # Without alignment, the positions differ by 90 mm at the median.
        assert np.median(worst) < 0.015


@pytest.mark.slow
def test_edges_are_placed_by_the_space_and_one_lost_keeps_the_other(session: PerformSession) -> None:
    stamp = uuid.uuid4().hex[:8]
    left, right = MovingEdge(f"left-{stamp}"), MovingEdge(f"right-{stamp}")
    turned = compose_transform(rotation_from_vector(np.array([0.0, np.pi / 2, 0.0])), np.array([0, 0, 4.0]))
    shifted = compose_transform(np.eye(3), np.array([1.0, 0.0, 0.0]))
    session.shared_space.space = Space(
        {
            left.publisher.name: Place(convert_to_nested_tuples(shifted)),
            right.publisher.name: Place(convert_to_nested_tuples(turned)),
        }
    )
    with contextlib.ExitStack() as stack:
        stack.callback(left.stop)
        stack.callback(right.stop)
        follow(session, left, right)
        (guest,) = session.secondary_edges
        until(session, lambda: is_aligned(session), left, right)
        assert session.scene is not None
        _, actor = session.scene.actors
        # The world of the right edge is rotated and shifted relative to the world of the left edge.
        relative = np.linalg.inv(shifted) @ turned
        joints = {body.id: body.joints for body in session.scene.bodies}
        moved = joints[find_shared_performer_id(1, 1)][0]
        assert abs(moved[0] - relative[0, 3]) < 1e-3 and moved[2] < relative[2, 3]
        np.testing.assert_allclose(
            actor.pose.linear[0], relative[:3, :3] @ right.character.rest_pose().linear[0], atol=1e-3
        )
        assert {a.character.id for a in session.scene.actors} == {"chair", f"{guest.name}/chair"}
        left.stop()
        until(session, lambda: not session.connected, right)
        before = guest.live.document.timeline.end_ns
        until(session, lambda: guest.live.document.timeline.end_ns > before + 300 * MS, right)
        assert guest.connected and f"{guest.name}/chair" in {a.character.id for a in session.scene.actors}


@pytest.mark.slow
def test_an_edge_without_a_place_is_reported(session: PerformSession) -> None:
    here, there = MovingEdge(uuid.uuid4().hex), MovingEdge(uuid.uuid4().hex)
    session.shared_space.space = Space({here.publisher.name: Place()})
    with contextlib.ExitStack() as stack:
        stack.callback(here.stop)
        stack.callback(there.stop)
        follow(session, here, there)
        until(session, lambda: is_aligned(session), here, there)
        texts = [f"{toast.text} {toast.remedy}" for toast in session.editor.toasts.shown]
        assert any(there.publisher.name in text and "--name" in text for text in texts), texts
        assert session.secondary_edges[0].feed.transform is None


def test_edges_of_one_name_do_not_mix() -> None:
    """Names are equal only on different machines, so this tests the names alone."""
    messages: list[tuple[str, str]] = []
    shared = SharedSpace(lambda problem, remedy: messages.append((problem, remedy)))
    shared.update_transforms("stage", [])
    assert shared.prefix_of(1, "stage") == "stage (2)" == shared.prefix_of(1, "stage")
    assert shared.prefix_of(2, "stage") == "stage (3)"
    assert shared.prefix_of(3, "hall") == "hall"
