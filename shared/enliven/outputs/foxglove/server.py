"""A WebSocket server for the Foxglove app, which displays the stage of an edge and plots its numbers.

Other outputs send to an address. This output listens, so that the app can connect and disconnect at any time.
Foxglove's protocol has no authentication, so addresses that other computers can reach are refused by default.
"""

from __future__ import annotations

import logging
import re
import socket
import threading
import time
from collections.abc import Sequence
from typing import Any

import foxglove
from foxglove.channels import (
    CameraCalibrationChannel,
    LogChannel,
    RawImageChannel,
)
from foxglove.messages import FrameTransforms, SceneUpdate
from foxglove.websocket import ChannelView, Client, ServerListener

from enliven.errors import ResourceError
from enliven.health import HealthState
from enliven.outputs.depth_memory import DEPTH_INTERVAL_NS
from enliven.outputs.foxglove import messages
from enliven.outputs.foxglove.stage_encoders import (
    STAGE_SCHEMA,
    SceneEncoder,
    StageEncoder,
    TransformsEncoder,
)
from enliven.outputs.live_frame import LiveFrame
from enliven.outputs.sender import Sender
from enliven.outputs.warmup import sample_frame

_BACKLOG = 32
"""Maximum number of queued messages for a slow client, about 0.3 s. The oldest messages are dropped."""
_MAX_STOP_S = 1.0
"""Maximum time in seconds to wait for the port to become free when the server stops. It usually takes about
10 ms."""
_STOP_STEP_S = 0.005
"""Interval in seconds between two checks of the port."""
_ERROR = re.compile(r"(?:FoxgloveError: )?(?:Failed to bind port: )?(.*?)(?: \(os error \d+\))?")
"""Matches an error message of the library. Group 1 is the reason, without the parts that enliven's own
message repeats."""


class FoxgloveServer(Sender):
    """Serves everything on the stage to any number of Foxglove clients.

    Messages are only encoded for topics with at least one subscriber. The library sends them from its own
    threads, and drops the oldest messages of a slow client.

    Args:
        name: name of the output, for error messages and the log.
        host: IP address to listen on.
        port: TCP port to listen on. 0 selects a free port.

    Attributes:
        port: the TCP port that the server listens on.

    Raises:
        ResourceError: if the port is in use, or the address does not belong to this machine.
    """

    def __init__(self, name: str, host: str, port: int) -> None:
        super().__init__(name)
        # The library logs while it holds locks that channel.log needs. Its log messages wait for Python's
        # global lock, which the caller of channel.log holds. This would be a deadlock, so its log must not
        # reach Python. FOXGLOVE_LOG_LEVEL overrides the first line below. The second line then disables the
        # library's log, except for the first message of each module.
        foxglove.set_log_level(logging.CRITICAL)
        logging.getLogger("foxglove").setLevel(logging.CRITICAL)
        context = self._context = foxglove.Context()  # Keep a reference, because the server does not.
        self._transforms = foxglove.Channel(
            "/tf", message_encoding="protobuf", schema=FrameTransforms.get_schema(), context=context
        )
        self._scene = foxglove.Channel(
            "/scene", message_encoding="protobuf", schema=SceneUpdate.get_schema(), context=context
        )
        self._stage = foxglove.Channel(
            "/stage", message_encoding="json", schema=STAGE_SCHEMA, context=context
        )
        self._encoders = TransformsEncoder(), SceneEncoder(), StageEncoder()
        StageEncoder().encode(sample_frame())  # Compiles all kernels of this module before the first frame.
        self._depth = RawImageChannel("/depth", context=context)
        self._calibration = CameraCalibrationChannel("/depth/calibration", context=context)
        self._health = LogChannel("/health", context=context)
        self._events_log = LogChannel("/events", context=context)
        self._lock = threading.Lock()
        self._states: dict[tuple[str, int, int], HealthState] = {}
        self._offset_ns: int | None = None
        self._last_ns = self._last_depth_ns = 0
        try:
            self._server = foxglove.start_server(
                name=name,
                host=host,
                port=port,
                context=context,
                server_listener=_Listener(self),
                message_backlog_size=_BACKLOG,
            )
        except RuntimeError as error:
            match = _ERROR.fullmatch(str(error))
            reason = match[1] if match else str(error)
            remedy = "End the other program that uses this port, or choose another port: foxglove:HOST:PORT."
            problem = f"port {port} of {host} cannot be opened ({reason})"
            raise ResourceError(problem, where=name, remedy=remedy) from None
        self._host, self.port = host, self._server.port

    @property
    def wants_depth(self) -> bool:
        """True if a client has subscribed to the depth image or to the camera calibration."""
        return bool(self._depth.has_sinks() or self._calibration.has_sinks())

    def put_health(self, states: Sequence[HealthState]) -> None:
        """Logs each state that began or ended since the last call in Foxglove's log panel."""
        now = messages.timestamp(time.time_ns())
        new = {(state.kind, state.performer, state.since_ns): state for state in states}
        with self._lock:
            old, self._states = self._states, new
        for key in new.keys() - old.keys():
            self._health.log(messages.health_log(new[key], now))
        for key in old.keys() - new.keys():
            self._health.log(messages.health_log(old[key], now, ended=True))

    def repeat_health(self) -> None:
        """Sends the current health states again when a client subscribes to them."""
        now = messages.timestamp(time.time_ns())
        with self._lock:
            states = list(self._states.values())
        for state in states:
            self._health.log(messages.health_log(state, now))

    def _send(self, frame: LiveFrame) -> None:
        time_ns = self._wall_time_ns(frame.time_ns)
        transforms, scene, stage = self._encoders
        if self._transforms.has_sinks():
            self._log(self._transforms, transforms.encode(frame, time_ns), time_ns)
        if self._scene.has_sinks():
            self._log(self._scene, scene.encode(frame, time_ns), time_ns)
        if self._stage.has_sinks():
            self._log(self._stage, stage.encode(frame), time_ns)
        for event in frame.events:
            self._log(self._events_log, messages.event_log(event, messages.timestamp(time_ns)), time_ns)
        self._send_depth(frame, time_ns)

    def _send_depth(self, frame: LiveFrame, time_ns: int) -> None:
        """Sends the depth image and the camera's calibration at a limited rate."""
        if frame.depth is None or 0 <= frame.time_ns - self._last_depth_ns < DEPTH_INTERVAL_NS:
            return
        self._last_depth_ns = frame.time_ns
        stamp = messages.timestamp(time_ns)
        if self._depth.has_sinks():
            self._log(self._depth, messages.depth_image(frame.depth, frame.mirrored, stamp), time_ns)
        if self._calibration.has_sinks():
            camera = messages.calibration(frame.depth.intrinsics, frame.mirrored, stamp)
            self._log(self._calibration, camera, time_ns)

    def _log(self, channel: Any, message: object, time_ns: int) -> None:
        channel.log(message, log_time=time_ns)
        self.sent += 1

    def _wall_time_ns(self, time_ns: int) -> int:
        """Converts the sensor's time to nanoseconds since 1970. The first frame gets the current time.

        If the sensor's clock jumps back, for example because a replay restarts, clients are told to discard
        their data with later times.
        """
        if self._offset_ns is None or time_ns < self._last_ns:
            if self._offset_ns is not None:
                self._server.clear_session()
            self._offset_ns = time.time_ns() - time_ns
        self._last_ns = time_ns
        return time_ns + self._offset_ns

    def close(self) -> None:
        """Stops the server, and waits for a limited time until the operating system has released the port."""
        self._server.stop()
        # The library closes its port in the background. Wait for it, because a restarted edge needs the port
        # immediately.
        deadline = time.monotonic() + _MAX_STOP_S
        while time.monotonic() < deadline and not _is_free(self._host, self.port):
            time.sleep(_STOP_STEP_S)


def _is_free(host: str, port: int) -> bool:
    """Returns True if the port is free for a server."""
    with socket.socket(socket.AF_INET6 if ":" in host else socket.AF_INET) as attempt:
        attempt.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            attempt.bind((host, port))
        except OSError:
            return False
    return True


class _Listener(ServerListener):
    """A listener for new subscriptions. It sends the health states to a client that subscribes to them."""

    def __init__(self, server: FoxgloveServer) -> None:
        self._server = server

    def on_subscribe(self, client: Client, channel: ChannelView) -> None:
        if channel.topic == "/health":
            self._server.repeat_health()
