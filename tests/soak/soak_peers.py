"""Other programs on the network of a soak: viewers that connect and disconnect, slow ones, and hostile
ones.
"""

from __future__ import annotations

import contextlib
import re
import socket
import subprocess
import sys
import time
from collections import Counter
from pathlib import Path

import numpy as np
import trimesh
import zmq

from enliven.formats.project.one_character import project_of_mesh
from enliven.meshes import Mesh
from enliven.wire import Done, Possess, Release, unpack_stream
from enliven_viewer.link.edge_client import EdgeClient

ATTACK_S = 8.0
"""Seconds of one attack."""
ATTACK_RATE = 5000
"""Items per second of an attack. The limit prevents the attack from occupying the edge's processor."""
STAY_S = (2.0, 15.0)
"""Range of the time for which a viewer stays connected, seconds."""
ANSWER_S = 20.0
"""Time after which a request counts as unanswered, for example because the edge was killed, seconds."""


class Watch:
    """A subscriber that counts messages and measures the silences between them.

    Attributes:
        counts: received messages by topic.
        visits: number of times that a person came into view.
        silences: (seconds of the end, length in seconds) of each silence above :attr:`noted_s`.
    """

    noted_s = 2.0
    """Silences longer than this are stored, seconds. Kills and lost sensors cause longer ones."""

    def __init__(self, port: int) -> None:
        self._context = zmq.Context()
        self._socket = self._context.socket(zmq.SUB)
        self._socket.setsockopt(zmq.SUBSCRIBE, b"")
        self._socket.connect(f"tcp://127.0.0.1:{port}")
        self.counts: dict[str, int] = {}
        self.visits, self._present = 0, set[int]()
        self.silences: list[tuple[float, float]] = []
        self._last = time.monotonic()

    def poll(self, at_s: float) -> None:
        """Reads all waiting messages."""
        while self._socket.poll(0):
            topic, message = unpack_stream(self._socket.recv())
            self.counts[topic.name] = self.counts.get(topic.name, 0) + 1
            if topic.name == "bodies":
                now = time.monotonic()
                if now - self._last > self.noted_s:
                    self.silences.append((at_s, now - self._last))
                self._last = now
                ids = {body.id for body in message.bodies}
                self.visits += len(ids - self._present)
                self._present = ids

    @property
    def silent_s(self) -> float:
        """Returns the seconds since the last message of people."""
        return time.monotonic() - self._last

    def close(self) -> None:
        self._context.destroy(linger=0)


class Guests:
    """Viewers that connect, change something, and leave. A third of them never reads.

    Attributes:
        answered, unanswered: numbers of requests.
        refusals: number of refused requests by reason.
    """

    def __init__(self, ports: tuple[int, int]) -> None:
        self._ports = ports
        self._address = f"127.0.0.1:{ports[0]}:{ports[1]}"
        self._clients: list[tuple[float, EdgeClient]] = []
        self._slow: list[tuple[float, socket.socket]] = []
        self._attacks: list[subprocess.Popen[bytes]] = []
        box = trimesh.creation.box((0.4, 0.5, 0.3))
        self._project = project_of_mesh(
            Mesh(box.vertices + np.array([0, 0.25, 0]), box.faces.astype("int32")), "box"
        )
        self._host = EdgeClient([self._address], "host")
        self._number = self._asked = 0
        self.answered = self.unanswered = 0
        self.refusals: Counter[str] = Counter()
        self._waiting: dict[int, float] = {}

    def connect(self, stay_s: float, reads: bool) -> None:
        """Connects a viewer. One that does not read only opens the connection and subscribes to
        everything.
        """
        end = time.monotonic() + stay_s
        if reads:
            self._clients.append((end, EdgeClient([self._address], "guest")))
            return
        with contextlib.suppress(OSError):
            slow = socket.create_connection(("127.0.0.1", self._ports[0]), timeout=1.0)
            slow.sendall(b"\xff" + bytes(8) + b"\x7f\3\1" + b"NULL".ljust(20, b"\0") + bytes(32))
            slow.sendall(b"\4\x19\5READY\x0bSocket-Type\0\0\0\3SUB" + b"\0\1\1")
            self._slow.append((end, slow))

    def upload(self) -> None:
        """Uploads a character and removes it when it has arrived."""
        self._number += 1
        name, number = f"guest {self._number % 3}", self._expect()

        def then(answer: object) -> None:
            self._answer(number, answer)
            if isinstance(answer, Done):
                removal = self._expect()
                self._host.stage.remove(name, lambda removed: self._answer(removal, removed))

        self._host.stage.put(self._project, "box", name=name, then=then)

    def possess(self) -> None:
        """Releases the chair and lets the person in view possess it again."""
        for order in (Release("chair"), Possess("chair")):
            number = self._expect()
            self._host.ask(order, lambda answer, number=number: self._answer(number, answer))

    def attack(self) -> None:
        """Starts a hostile program."""
        command = [sys.executable, __file__, *map(str, self._ports)]
        self._attacks.append(subprocess.Popen(command, stdout=subprocess.DEVNULL))

    def poll(self) -> None:
        """Lets all viewers read, and disconnects those whose time is over."""
        now = time.monotonic()
        self._host.poll()
        for end, client in list(self._clients):
            client.poll()
            if now > end:
                client.close()
                self._clients.remove((end, client))
        for end, slow in list(self._slow):
            if now > end:
                slow.close()
                self._slow.remove((end, slow))
        for number, asked in list(self._waiting.items()):
            if now - asked > ANSWER_S:
                del self._waiting[number]
                self.unanswered += 1
        self._attacks = [attack for attack in self._attacks if attack.poll() is None]

    def close(self) -> None:
        for _, client in self._clients:
            client.close()
        for _, slow in self._slow:
            slow.close()
        for attack in self._attacks:
            attack.kill()
            attack.wait()
        self._host.close()

    def _expect(self) -> int:
        self._asked += 1
        self._waiting[self._asked] = time.monotonic()
        return self._asked

    def _answer(self, number: int, answer: object) -> None:
        if self._waiting.pop(number, None) is None:
            return
        if isinstance(answer, Done):
            self.answered += 1
        else:
            reason = getattr(answer, "reason", type(answer).__name__)
            self.refusals[re.sub(r"\d+", "N", reason)[:120]] += 1


def attack(pose_port: int, control_port: int) -> None:
    """Sends valid requests, resets, subscriptions and unread requests, as `make bench ONLY=hostile` does."""
    sys.path.insert(0, str(Path(__file__).parents[1] / "benchmarks"))
    from bench_hostile import connect_strangers

    strangers, sent, start = connect_strangers(pose_port, control_port), 0, time.monotonic()
    while (passed := time.monotonic() - start) < ATTACK_S:
        if sent > ATTACK_RATE * passed:
            time.sleep(0.02)
            continue
        pushed = sum(each.push() for each in strangers)
        sent += pushed
        if not pushed:
            for each in strangers[2:]:
                each.leave()
            time.sleep(0.02)


if __name__ == "__main__":
    attack(int(sys.argv[1]), int(sys.argv[2]))
