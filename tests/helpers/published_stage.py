"""Publishes the poses of chosen characters repeatedly from a thread over real sockets, as an edge does."""

from __future__ import annotations

import threading
import time
from collections.abc import Mapping

from enliven.document import Character, Pose
from enliven.person import Body
from enliven.wire import bodies_to_message, cues_to_message
from enliven_edge.network.publisher import Publisher

INTERVAL_S = 0.03
"""Seconds between two frames."""


class PublishedStage:
    """A thread that publishes until :meth:`close`. Use it as a context manager.

    Args:
        name: name of the edge, unique on this machine.
        poses: the characters with the pose of each, which may be replaced at any time.
        bodies: the people in view.
        holders: performer of each possessed character.
        ports: ports of the streams and of the requests, 0 for any free port.
    """

    def __init__(
        self,
        name: str,
        poses: Mapping[str, tuple[Character, Pose]],
        bodies: tuple[Body, ...] = (),
        holders: Mapping[str, int] | None = None,
        ports: tuple[int, int] = (0, 0),
    ) -> None:
        self.poses, self.bodies, self.holders = dict(poses), bodies, holders or {}
        self.frames = 0
        self._publisher = Publisher(name=name, pose_port=ports[0], control_port=ports[1], rate=1000.0)
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run)
        self._thread.start()

    @property
    def ports(self) -> tuple[int, int]:
        """Returns the ports of the streams and of the requests."""
        endpoint = self._publisher.endpoint
        return endpoint.pose_port, endpoint.control_port

    @property
    def address(self) -> str:
        """Returns the address for viewers."""
        return str(self._publisher.endpoint)

    def __enter__(self) -> PublishedStage:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Ends the thread and closes the sockets."""
        self._stop.set()
        self._thread.join()

    def _run(self) -> None:
        try:
            previous: dict[str, Character] = {}
            while not self._stop.is_set():
                poses = dict(self.poses)
                for name in previous.keys() - poses.keys():
                    self._publisher.remove_character(name)
                for name, (character, _) in poses.items():
                    if previous.get(name) is not character:
                        self._publisher.set_character(character)
                previous = {name: character for name, (character, _) in poses.items()}
                self._publish(poses)
                self.frames += 1
                self._stop.wait(INTERVAL_S)
        finally:
            self._publisher.close()

    def _publish(self, poses: Mapping[str, tuple[Character, Pose]]) -> None:
        now = time.time_ns()
        for name, (_, pose) in poses.items():
            self._publisher.publish_pose(pose, now)
            if name in self.holders:
                cues = cues_to_message(name, "possessed", [0], [1.0], self.holders[name], now)
                self._publisher.publish(cues)
        self._publisher.publish(bodies_to_message(self.bodies, now, now))
        self._publisher.set_status(fps=1 / INTERVAL_S, phase="tracking", performers=len(self.bodies))
        self._publisher.poll()
