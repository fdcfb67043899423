"""The colour of an OAK in addition to its depth.

Depth is registered to the colour camera, and the images are synchronised by time.
"""

from __future__ import annotations

from datetime import timedelta
from typing import Any

import numpy as np

from enliven.arrays import UInt8, UInt16


def create_aligned_outputs(
    dai: Any, pipeline: Any, stereo: Any, size: tuple[int, int], fps: float
) -> tuple[Any, Any]:
    """Returns (depth, colour) outputs of a device, both registered to the colour camera and undistorted."""
    camera = pipeline.create(dai.node.Camera).build(dai.CameraBoardSocket.CAM_A)
    colour = camera.requestOutput(size, dai.ImgFrame.Type.RGB888i, fps=fps, enableUndistortion=True)
    if pipeline.getDefaultDevice().getPlatform() != dai.Platform.RVC4:
        colour.link(stereo.inputAlignTo)
        return stereo.depth, colour
    align = pipeline.create(dai.node.ImageAlign)
    stereo.depth.link(align.input)
    colour.link(align.inputAlignTo)
    return align.outputAligned, colour


def synchronise(dai: Any, pipeline: Any, depth: Any, colour: Any, fps: float) -> Any:
    """Returns groups of a "depth" and a "colour" image, taken within half a frame interval.

    The images are grouped on this machine and not on the device.
    """
    sync = pipeline.create(dai.node.Sync)
    sync.setRunOnHost(True)
    sync.setSyncThreshold(timedelta(seconds=0.5 / fps))
    depth.link(sync.inputs["depth"])
    colour.link(sync.inputs["colour"])
    return sync.out


def create_image_message(dai: Any, pixels: UInt8 | UInt16, kind: Any, number: int, time_ns: int) -> Any:
    """Returns an image as a message of the library: (H, W) depth or (H, W, 3) colour."""
    image = dai.ImgFrame()
    image.setType(kind)
    image.setWidth(pixels.shape[1])
    image.setHeight(pixels.shape[0])
    image.setStride(pixels[0].nbytes)
    image.setData(np.ascontiguousarray(pixels).view(np.uint8).ravel())
    image.setSequenceNum(number)
    image.setTimestamp(timedelta(microseconds=time_ns / 1000))
    return image
