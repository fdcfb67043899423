"""Receives the bones of a figure by the VMC protocol, with the standard library alone."""

import math
import socket

from .osc import read_packet

MAX_PACKETS = 500
"""Maximum number of packets that are read at once, so that a flood cannot stop Blender."""


class VmcReceiver:
    """A UDP port that keeps the newest place of each bone.

    Args:
        host: the address to listen on. "0.0.0.0" also accepts other computers.
        port: the UDP port. 0 picks a free one.

    Attributes:
        bones: by name in Unity's humanoid: position (x, y, z) and rotation (w, x, y, z), both relative to the
            parent bone and in Blender's axes.
        packets: number of packets that came.

    Raises:
        OSError: for a port in use.
    """

    def __init__(self, host, port):
        self.bones, self.packets, self.is_loaded = {}, 0, True
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 20)
            self._socket.bind((host, port))
        except OSError:
            self._socket.close()
            raise
        self._socket.setblocking(False)
        self.port = self._socket.getsockname()[1]

    def poll(self):
        """Reads all packets that wait. Returns True if bones came."""
        came = False
        for _ in range(MAX_PACKETS):
            try:
                data = self._socket.recv(65536)
            except OSError:  # Nothing waits, or the last answer was an error of the network.
                break
            self.packets += 1
            try:
                messages = read_packet(data)
            except ValueError:
                continue
            for address, arguments in messages:
                came = self._take(address, arguments) or came
        return came

    def close(self):
        """Frees the port."""
        self._socket.close()

    def _take(self, address, arguments):
        if address == "/VMC/Ext/OK" and arguments:
            self.is_loaded = arguments[0] != 0
        if address != "/VMC/Ext/Bone/Pos" or len(arguments) < 8 or not isinstance(arguments[0], str):
            return False
        numbers = arguments[1:8]
        if not all(isinstance(each, (int, float)) and math.isfinite(each) for each in numbers):
            return False
        length = math.sqrt(sum(each * each for each in numbers[3:]))
        if length < 1e-6:
            return False
        x, y, z, i, j, k, w = [float(each) for each in numbers]
        # Unity is left-handed with +Y up, and Blender is right-handed with +Z up. A figure that faces +Z in
        # Unity faces -Y in Blender, and its left is at -X in Unity and at +X in Blender.
        turn = tuple(each / length for each in (w, i, k, -j))
        self.bones[arguments[0]] = (-x, -z, y), turn
        return True
