"""Independent receivers of live outputs. OSC uses python-osc's dispatcher, JSON the standard library.

They share no code with the senders. :class:`Avatar` does what a receiving program does with VMC. It applies
local rotations to its own skeleton in the T-pose, in Unity's left-handed axes, without code from the package.
"""

from __future__ import annotations

import json
import socket
import threading
from collections import defaultdict

import lz4.frame
import numpy as np
from pythonosc.dispatcher import Dispatcher
from pythonosc.osc_server import BlockingOSCUDPServer


class OscReceiver:
    """A UDP server on loopback that keeps the newest arguments of each OSC address.

    Attributes:
        values: newest arguments by address. The key is (address, text) if the first argument is a text.
        history: all arguments by the same keys.
        sizes: bytes of the received packets.
    """

    def __init__(self, port: int = 0) -> None:
        self.values, self.history, self.sizes = {}, defaultdict(list), []
        dispatcher = Dispatcher()
        dispatcher.set_default_handler(self._record_message)
        sizes = self.sizes

        # A thread per packet would allow an older packet to overtake a newer one, so one thread handles all.
        class Server(BlockingOSCUDPServer):
            def verify_request(self, request, client_address):
                sizes.append(len(request[0]))
                return super().verify_request(request, client_address)

        self._server = Server(("127.0.0.1", port), dispatcher)
        self.port = self._server.server_address[1]
        self._thread = threading.Thread(target=self._server.serve_forever, args=(0.02,), daemon=True)
        self._thread.start()

    def _record_message(self, address, *arguments):
        key = (address, arguments[0]) if arguments and isinstance(arguments[0], str) else address
        self.values[key] = arguments[1:] if isinstance(key, tuple) else arguments
        self.history[key].append(self.values[key])

    def __enter__(self):
        return self

    def __exit__(self, *error):
        self._server.shutdown()
        self._server.server_close()
        self._thread.join()


class JsonReceiver:
    """A UDP socket on loopback that reads Rokoko's JSON, compressed or not."""

    def __init__(self) -> None:
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.bind(("127.0.0.1", 0))
        self._socket.settimeout(30.0)
        self.port = self._socket.getsockname()[1]

    def read(self) -> dict:
        """Waits for one packet and returns its content."""
        data = self._socket.recv(1 << 16)
        return json.loads(lz4.frame.decompress(data) if data[:4] == b"\x04\x22\x4d\x18" else data)

    def __enter__(self):
        return self

    def __exit__(self, *error):
        self._socket.close()


def turn(quaternion, vector) -> np.ndarray:
    """Returns a vector rotated by a quaternion (x, y, z, w) through its rotation matrix."""
    x, y, z, w = quaternion
    matrix = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.array(matrix) @ np.asarray(vector, float)


def euler_turn(degrees, vector) -> np.ndarray:
    """Returns a vector rotated by Unity's Euler angles: about Z, then X, then Y."""
    x, y, z = np.radians(degrees)
    about_z = np.array([[np.cos(z), -np.sin(z), 0], [np.sin(z), np.cos(z), 0], [0, 0, 1]])
    about_x = np.array([[1, 0, 0], [0, np.cos(x), -np.sin(x)], [0, np.sin(x), np.cos(x)]])
    about_y = np.array([[np.cos(y), 0, np.sin(y)], [0, 1, 0], [-np.sin(y), 0, np.cos(y)]])
    return about_y @ about_x @ about_z @ np.asarray(vector, float)


ENDS = {
    "LeftUpperArm": (-1, 0, 0),
    "LeftLowerArm": (-1, 0, 0),
    "LeftHand": (-1, 0, 0),
    "RightUpperArm": (1, 0, 0),
    "RightLowerArm": (1, 0, 0),
    "RightHand": (1, 0, 0),
    "LeftUpperLeg": (0, -1, 0),
    "LeftLowerLeg": (0, -1, 0),
    "RightUpperLeg": (0, -1, 0),
    "RightLowerLeg": (0, -1, 0),
}
"""Direction of each limb's bone in the T-pose."""
PARENTS = {
    "Hips": None,
    "Spine": "Hips",
    "Chest": "Spine",
    "UpperChest": "Chest",
    "Neck": "UpperChest",
    "Head": "Neck",
    **{f"{s}Shoulder": "UpperChest" for s in ("Left", "Right")},
    **{f"{s}UpperArm": f"{s}Shoulder" for s in ("Left", "Right")},
    **{f"{s}LowerArm": f"{s}UpperArm" for s in ("Left", "Right")},
    **{f"{s}Hand": f"{s}LowerArm" for s in ("Left", "Right")},
    **{f"{s}UpperLeg": "Hips" for s in ("Left", "Right")},
    **{f"{s}LowerLeg": f"{s}UpperLeg" for s in ("Left", "Right")},
    **{f"{s}Foot": f"{s}LowerLeg" for s in ("Left", "Right")},
}
"""The parent of each bone."""


class Avatar:
    """A receiver's avatar. In the T-pose it faces +Z, and its left is -X.

    Args:
        local: the seven numbers of VMC (position and quaternion) of each bone.
    """

    def __init__(self, local) -> None:
        self._local = local

    def rotate_direction(self, bone, vector) -> np.ndarray:
        """Returns a T-pose direction, rotated by a bone and all its ancestors."""
        vector = np.asarray(vector, float)
        while bone is not None:
            if bone in self._local:
                vector = turn(self._local[bone][3:], vector)
            bone = PARENTS[bone]
        return vector

    def direction(self, bone) -> np.ndarray:
        """Returns the direction of a limb's bone."""
        return self.rotate_direction(bone, ENDS[bone])

    def position(self, bone) -> np.ndarray:
        """Returns the position of the head of a bone, computed from the local positions alone."""
        place = np.zeros(3)
        while bone is not None:
            if bone in self._local:
                place = np.array(self._local[bone][:3]) + turn(self._local[bone][3:], place)
            bone = PARENTS[bone]
        return place
