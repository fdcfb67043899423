"""Reads the frame rate of a GLB file, and whether its bones change their size. It needs no Blender."""

import json
import struct

_MAX_RATE = 240.0
_UNEQUAL = 1e-3
"""Difference of scales along the axes, above which a bone counts as squeezed."""


class GlbMotion:
    """The motion of a GLB file.

    Args:
        path: of the file.

    Attributes:
        rate: frames per second, 0 without an animation.
        seconds: length of the longest animation.
        is_squeezed: True if a bone has different scales along its axes at some time.

    Raises:
        ValueError: for a file that is not GLB 2.
    """

    def __init__(self, path):
        with open(path, "rb") as file:
            data = file.read()
        if len(data) < 20 or data[:4] != b"glTF" or struct.unpack_from("<I", data, 4)[0] != 2:
            raise ValueError(f"{path} is not a GLB file of version 2")
        (size,) = struct.unpack_from("<I", data, 12)
        self._document = json.loads(data[20 : 20 + size])
        self._binary = data[28 + size :]
        self.rate = self.seconds = 0.0
        self.is_squeezed = False
        for animation in self._document.get("animations", ()):
            for channel in animation["channels"]:
                self._add(animation["samplers"][channel["sampler"]], channel["target"]["path"])

    def _add(self, sampler, path):
        times = self._floats(sampler["input"])
        if len(times) > 1 and times[-1] > times[0]:
            step = (times[-1] - times[0]) / (len(times) - 1)
            self.rate = max(self.rate, min(1.0 / step, _MAX_RATE))
        if times:
            self.seconds = max(self.seconds, times[-1])
        if path == "scale":
            values = self._floats(sampler["output"])
            rows = [values[k : k + 3] for k in range(0, len(values) - 2, 3)]
            self.is_squeezed = self.is_squeezed or any(max(row) - min(row) > _UNEQUAL for row in rows)

    def _floats(self, number):
        """Returns the numbers of an accessor. Empty if they are not 32-bit floats in one piece."""
        accessor = self._document["accessors"][number]
        if accessor["componentType"] != 5126 or "bufferView" not in accessor:
            return ()
        view = self._document["bufferViews"][accessor["bufferView"]]
        start = view.get("byteOffset", 0) + accessor.get("byteOffset", 0)
        count = accessor["count"] * {"SCALAR": 1, "VEC3": 3, "VEC4": 4}.get(accessor["type"], 0)
        if view.get("byteStride") or start + 4 * count > len(self._binary):
            return ()
        return struct.unpack_from(f"<{count}f", self._binary, start)
