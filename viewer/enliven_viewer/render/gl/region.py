"""Rectangular regions of an image."""

from __future__ import annotations

Region = tuple[int, int, int, int]
"""Left, bottom, width and height in pixels, from the lower left of the image."""


def full_region(size: tuple[int, int]) -> Region:
    """Returns the whole region of an image of this size."""
    return 0, 0, *size


def regions_around(region: Region, size: tuple[int, int]) -> list[Region]:
    """Returns the rest of an image around a region, as at most four regions."""
    x, y, width, height = region
    right, top = x + width, y + height
    outer_regions = [
        (0, 0, size[0], y),
        (0, top, size[0], size[1] - top),
        (0, y, x, height),
        (right, y, size[0] - right, height),
    ]
    return [part for part in outer_regions if part[2] > 0 and part[3] > 0]
