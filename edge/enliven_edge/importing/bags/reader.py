"""The reader of the makers' own recordings."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

from enliven.errors import InputError
from enliven.frames import DepthFrame
from enliven_edge.importing.bags import orbbec, realsense, ros1, ros2
from enliven_edge.importing.base import DEFAULT_OPTIONS, FileReader, ImportOptions, read_head


class BagReader(FileReader):
    """A recording of librealsense (.bag, .db3) or of OrbbecSDK (.bag): the depth camera and its images."""

    name = "bag"
    description = "recordings of RealSense (.bag, .db3) and Orbbec (.bag) tools"
    note = ""

    def matches(self, path: Path) -> bool:
        """Returns True for the magic bytes of a ROS 1 bag, or of a SQLite file that is named .db3."""
        head = read_head(path, len(ros2.MAGIC))
        return head.startswith(ros1.MAGIC) or (head == ros2.MAGIC and path.suffix == ".db3")

    def read(self, paths: Sequence[Path], options: ImportOptions = DEFAULT_OPTIONS) -> Iterator[DepthFrame]:
        """Yields the depth frames of the camera that the topics name: RealSense or Orbbec.

        Raises:
            InputError: for a damaged bag, or a bag without images of these cameras.
        """
        path = self.choose_file(paths)
        if read_head(path, len(ros2.MAGIC)) == ros2.MAGIC:
            yield from realsense.frames(path, ros2.messages, options.device)
            return
        for topic, _ in ros1.messages(path, lambda topic: True):
            if topic.startswith(orbbec.PREFIX):
                yield from orbbec.frames(path, options.device)
                return
            if realsense.TOPIC.match(topic):
                yield from realsense.frames(path, ros1.messages, options.device)
                return
        remedy = "Choose a recording of a RealSense or Orbbec camera."
        raise InputError(
            "the ROS bag contains no images of a supported camera", where=str(path), remedy=remedy
        )
