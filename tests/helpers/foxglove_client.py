"""An independent client of Foxglove's WebSocket protocol, which decodes messages by the announced schemas.

It shares no code with the server: the connection is that of the library websockets, and the messages are read
by Google's protobuf with the descriptors that the server sends.
"""

from __future__ import annotations

import base64
import json
import struct
from collections import defaultdict

from google.protobuf import descriptor_pb2, descriptor_pool, message_factory
from websockets.sync.client import connect

MESSAGE_DATA = 1
"""Operation code of a message on a channel."""


class FoxgloveClient:
    """A connection that subscribes to topics, and keeps the messages of each.

    Args:
        port: the server's port on this computer.
        topics: topics to subscribe to, None for all.

    Attributes:
        info: the server's introduction.
        channels: announced channels, by topic.
        messages: decoded messages by topic, with their time in nanoseconds.
    """

    def __init__(self, port: int, topics=None, host: str = "127.0.0.1") -> None:
        self.socket = connect(
            f"ws://{host}:{port}", subprotocols=["foxglove.sdk.v1"], max_size=None, legacy=True
        )
        self.info = json.loads(self.socket.recv(30))
        self.channels = {}
        while not self.channels:
            text = json.loads(self.socket.recv(30))
            if text["op"] == "advertise":
                self.channels = {channel["topic"]: channel for channel in text["channels"]}
        self.messages = defaultdict(list)
        self.texts = []
        wanted = list(self.channels) if topics is None else topics
        self._topics = {number: topic for number, topic in enumerate(wanted, 100)}
        subscriptions = [{"id": n, "channelId": self.channels[t]["id"]} for n, t in self._topics.items()]
        self.socket.send(json.dumps({"op": "subscribe", "subscriptions": subscriptions}))

    def poll(self, seconds: float = 0.0) -> None:
        """Reads all messages that have arrived. Waits at most ``seconds`` for the first one."""
        while True:
            try:
                data = self.socket.recv(seconds)
            except TimeoutError:
                return
            if isinstance(data, str):
                self.texts.append(json.loads(data))
                continue
            code, number, time_ns = struct.unpack_from("<BIQ", data)
            assert code == MESSAGE_DATA
            topic = self._topics[number]
            self.messages[topic].append((self._decode(topic, data[13:]), time_ns))
            seconds = 0.0

    def newest(self, topic: str):
        """Returns the newest message of a topic, or None."""
        self.poll(0.05)
        return self.messages[topic][-1][0] if self.messages[topic] else None

    def _decode(self, topic: str, data: bytes):
        channel = self.channels[topic]
        if channel["encoding"] == "json":
            return json.loads(data)
        return read_message(channel["schemaName"], base64.b64decode(channel["schema"]), data)

    def close(self) -> None:
        self.socket.close()

    def __enter__(self):
        return self

    def __exit__(self, *error):
        self.close()


def read_message(name: str, schema: bytes, data: bytes):
    """Returns a Protobuf message, decoded by the descriptor of its schema."""
    files = descriptor_pb2.FileDescriptorSet.FromString(schema)
    pool = descriptor_pool.DescriptorPool()
    for file in files.file:
        pool.Add(file)
    return message_factory.GetMessageClass(pool.FindMessageTypeByName(name)).FromString(data)
