"""Draws one frame: depth in grey, each person's pixels tinted, skeletons coloured by confidence."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from PIL import Image, ImageDraw

from enliven.arrays import AnyArray, Float, UInt8, UInt16
from enliven.camera import Intrinsics, project
from enliven.person import BONES, Body

_TINTS = np.array(
    [(70, 130, 255), (255, 140, 60), (90, 220, 120), (230, 90, 210), (240, 220, 70), (90, 220, 230)], float
)
"""(6, 3) sRGB tints that are easy to distinguish. The people get them in turn."""
_MIN_JOINT_DEPTH_M = 0.12
"""Minimum distance from the camera of joints that are drawn, in metres. The projection of nearer joints
leaves the image."""
_HOLE_GREY = 12
"""Grey value in 0..255 of a pixel without depth. It is darker than every distance, and lighter than black."""
_MIN_CONFIDENCE = 0.05
"""Bones with both ends below this confidence are not drawn."""


def depth_picture(depth: UInt16, near: float, far: float) -> UInt8:
    """Returns an (H, W, 3) grey image of depth: bright is near, dark is ``far`` metres or beyond.

    Unknown depth is nearly black.
    """
    z = depth.astype(np.float64) * 1e-3
    grey = 235.0 - 190.0 * np.clip((z - near) / max(far - near, 1e-6), 0.0, 1.0)
    grey[depth == 0] = _HOLE_GREY
    return np.repeat(grey.astype(np.uint8)[..., None], 3, axis=2)


def depth_span(depth: UInt16) -> tuple[float, float]:
    """Returns the near and far distances in metres between which most depths of an image lie.

    They are arguments of :func:`depth_picture`.
    """
    measured_depths = depth[(depth > 0) & (depth < 65535)]
    if measured_depths.size == 0:
        return 0.5, 4.0
    near, far = np.percentile(measured_depths[:: max(1, measured_depths.size // 20000)], [1.0, 97.0]) * 1e-3
    return float(near), float(max(far, near + 0.3))


def tint_people(picture: UInt8, owner: AnyArray, depth: UInt16) -> UInt8:
    """Returns the image with the known pixels of each person coloured.

    Args:
        owner: (h, w) the person at each pixel of a downsampled image: 0, 1, ..., or -1 for none.
        depth: (H, W) depth of the image.
    """
    height, width = picture.shape[:2]
    rows = np.minimum(np.arange(height) * owner.shape[0] // height, owner.shape[0] - 1)
    columns = np.minimum(np.arange(width) * owner.shape[1] // width, owner.shape[1] - 1)
    people = np.where(depth > 0, owner[rows[:, None], columns[None]], -1)
    tinted = picture.astype(np.float64)
    mask = people >= 0
    tinted[mask] = tinted[mask] * (0.25 + 0.6 * _TINTS[people[mask] % len(_TINTS)] / 255.0)
    return np.asarray(tinted.astype(np.uint8))


def confidence_colour(confidence: float) -> tuple[int, int, int]:
    """Returns a colour from red (confidence 0) through yellow to green (confidence 1)."""
    c = min(max(confidence, 0.0), 1.0)
    return (255, round(510 * c), 40) if c < 0.5 else (round(510 * (1.0 - c)), 255, 40)


def draw_bodies(
    picture: UInt8,
    bodies: Sequence[Body],
    intrinsics: Intrinsics,
    world_from_camera: Float,
    scale: float = 1.0,
) -> UInt8:
    """Returns the image (``scale`` times the camera's size) with the skeletons and their ids."""
    image = Image.fromarray(picture)
    draw = ImageDraw.Draw(image)
    rotation, origin = world_from_camera[:3, :3], world_from_camera[:3, 3]
    for body in bodies:
        local = (body.joints - origin) @ rotation
        is_visible = local[:, 2] > _MIN_JOINT_DEPTH_M
        uv = np.zeros((len(local), 2))
        uv[is_visible] = (project(local[is_visible], intrinsics) + 0.5) * scale
        for a, b in BONES:
            confidence = float(min(body.confidence[a], body.confidence[b]))
            if (
                is_visible[a]
                and is_visible[b]
                and max(body.confidence[a], body.confidence[b]) >= _MIN_CONFIDENCE
            ):
                draw.line(
                    [*uv[a], *uv[b]], fill=confidence_colour(confidence), width=max(1, round(2 * scale))
                )
        for j in np.flatnonzero(is_visible):
            _draw_joint(draw, uv[j], 3.0 * scale, float(body.confidence[j]))
        if is_visible[3]:
            draw.text((uv[3, 0] + 8 * scale, uv[3, 1] - 18 * scale), str(body.id), fill=(255, 255, 255))
    return np.asarray(image)


def _draw_joint(draw: ImageDraw.ImageDraw, centre: AnyArray, radius: float, confidence: float) -> None:
    """Draws a joint: filled if it is observed, a ring if it is estimated."""
    box = [centre[0] - radius, centre[1] - radius, centre[0] + radius, centre[1] + radius]
    if confidence >= _MIN_CONFIDENCE:
        draw.ellipse(box, fill=confidence_colour(confidence), outline=(0, 0, 0))
    else:
        draw.ellipse(box, outline=(150, 40, 40))


def add_caption(picture: UInt8, lines: Sequence[str], colour: tuple[int, int, int] = (255, 230, 90)) -> UInt8:
    """Returns the image with lines of text in its lower left corner."""
    image = Image.fromarray(picture)
    draw = ImageDraw.Draw(image)
    for n, line in enumerate(reversed(lines)):
        origin = (6, image.height - 14 * (n + 1) - 4)
        draw.text((origin[0] + 1, origin[1] + 1), line, fill=(0, 0, 0))
        draw.text(origin, line, fill=colour)
    return np.asarray(image)


def contact_sheet(pictures: Sequence[UInt8], columns: int, width: int) -> UInt8:
    """Returns a contact sheet of many images, ``columns`` in a row, each ``width`` pixels wide."""
    thumbnails = []
    for picture in pictures:
        height = max(1, round(picture.shape[0] * width / picture.shape[1]))
        thumbnails.append(np.asarray(Image.fromarray(picture).resize((width, height))))
    heights = max(s.shape[0] for s in thumbnails)
    rows = -(-len(thumbnails) // columns)
    sheet = np.zeros((rows * heights, columns * width, 3), np.uint8)
    for n, picture in enumerate(thumbnails):
        top, left = n // columns * heights, n % columns * width
        sheet[top : top + picture.shape[0], left : left + width] = picture
    return sheet
