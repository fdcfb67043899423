"""The image sources of a scan: a recording, or a sensor that is read until ``stop`` is set."""

from __future__ import annotations

import logging
import threading
from collections.abc import Iterator
from pathlib import Path

from enliven.errors import InputError
from enliven.frames import DepthFrame
from enliven.recording import DEPTH_TOPIC, Recording
from enliven_edge.sensors import SensorFault, open_reopening, sensor_opener, sensor_options
from enliven_edge.tracking.frame.frame_check import find_flaw

log = logging.getLogger(__name__)

_FRAME_TIMEOUT_S = 0.25
"""Seconds to wait for a frame before checking whether to stop."""


def read_recorded_images(path: Path, stop: threading.Event) -> Iterator[DepthFrame]:
    """Yields the depth images of a recording, until ``stop`` is set.

    Raises:
        InputError: if the recording has no depth images.
    """
    source = Recording(path)
    if DEPTH_TOPIC not in source.info.topics:
        remedy = "Choose a recording of a depth camera."
        raise InputError("the recording has no depth images", where=str(path), remedy=remedy)
    for frame in source.frames():
        if stop.is_set():
            return
        if isinstance(frame, DepthFrame):
            yield frame


def sensor_images(name: str, options: list[str], stop: threading.Event) -> Iterator[DepthFrame]:
    """Yields the depth images of a sensor until ``stop`` is set. If the sensor fails, it is opened again."""
    with open_reopening(sensor_opener(name, **sensor_options(options))) as stream:
        while not stop.is_set():
            try:
                frame = stream.read(_FRAME_TIMEOUT_S)
            except TimeoutError:
                continue
            except (SensorFault, InputError) as error:
                # Open the sensor again, and keep the current scan.
                log.warning("%s", error)
                continue
            if frame is None:
                return
            if isinstance(frame, DepthFrame) and not find_flaw(frame):
                yield frame
