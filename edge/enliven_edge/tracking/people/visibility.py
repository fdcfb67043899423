"""The visibility of a body under occlusion.

It measures which fractions are occluded or outside the image, and which samples are on the person's own
pixels.
"""

from __future__ import annotations

import numpy as np

from enliven.arrays import Bool, Int16
from enliven.kernels import njit
from enliven_edge.tracking.body_model import model
from enliven_edge.tracking.body_model.posture import Posture
from enliven_edge.tracking.frame.observation import FrameView

_CAPSULE_SAMPLES = 3
"""Samples along a capsule: its ends and its middle show whether it is occluded."""
_OCCLUDER_DISTANCE_M = 0.12
"""Minimum distance in metres in front of a capsule's surface for depth to occlude it. Depth at smaller
distances may be clothes.
"""
_MIN_DEPTH_M = 0.1
"""Minimum depth in metres of a sample to be projected into the image."""
_MIN_TRUNK_FRACTION = 0.25
"""Minimum fraction of the trunk that is unoccluded and in the image. With less, fractions of the visible
trunk are unreliable.
"""
_TRUNK = np.flatnonzero(model.CAPSULES.frame <= model.HEAD)
"""The capsules of trunk, neck and head."""


def compute_occluded_fractions(
    view: FrameView, posture: Posture, owner: Int16, index: int
) -> tuple[float, float]:
    """Returns the fractions of a body that are occluded and outside the image, each in [0, 1].

    Args:
        view: the frame.
        posture: the body.
        owner: (h, w) the index of the person at each pixel; a person's own pixels occlude nothing.
        index: the index of this person.
    """
    view_arguments = (view.z, owner, index, view.camera.camera, view.world_from_camera)
    hidden, outside = _hidden(*posture.capsules(), *view_arguments)
    return hidden, outside


def compute_visible_trunk_fraction(view: FrameView, posture: Posture, pixels: Bool) -> float:
    """Returns the fraction in [0, 1] of the visible trunk and head that is on the (h, w) ``pixels``."""
    ends, radii = posture.capsules()
    view_arguments = (view.z, pixels.astype(np.int16), 1, view.camera.camera, view.world_from_camera)
    inside, covered, own_pixels = _samples(ends[_TRUNK], radii[_TRUNK], *view_arguments)
    is_visible = inside & ~(covered & ~own_pixels)
    return (
        float((own_pixels & is_visible).sum() / len(own_pixels))
        if is_visible.mean() < _MIN_TRUNK_FRACTION
        else float(own_pixels[is_visible].mean())
    )


@njit(cache=True, nogil=True)
def _samples(ends, radii, depth, owner, mine, camera, pose):
    """Returns (3, S) flags of samples along the capsules: in the image, occluded, and on pixels of ``mine``.

    Args:
        ends, radii: the capsules.
        depth: (h, w) metres.
        owner: (h, w) the index of the person at each pixel.
        mine: the index of this person.
        camera, pose: the camera.
    """
    height, width = depth.shape
    out = np.zeros((3, len(ends) * _CAPSULE_SAMPLES), np.bool_)
    for n in range(out.shape[1]):
        c, t = n // _CAPSULE_SAMPLES, (n % _CAPSULE_SAMPLES) / (_CAPSULE_SAMPLES - 1)
        x, y, z = 0.0, 0.0, 0.0
        for b in range(3):
            offset = ends[c, 0, b] + t * (ends[c, 1, b] - ends[c, 0, b]) - pose[b, 3]
            x += pose[b, 0] * offset
            y += pose[b, 1] * offset
            z += pose[b, 2] * offset
        if z <= _MIN_DEPTH_M:
            continue
        u = int(np.floor(camera[0] * x / z + camera[2] + 0.5))
        v = int(np.floor(camera[1] * y / z + camera[3] + 0.5))
        if 0 <= u < width and 0 <= v < height:
            seen, radius = depth[v, u], max(radii[c, 0], radii[c, 1])
            out[0, n], out[2, n] = True, owner[v, u] == mine
            out[1, n] = 0.0 < seen < z - radius - _OCCLUDER_DISTANCE_M
    return out


@njit(cache=True, nogil=True)
def _hidden(ends, radii, depth, owner, mine, camera, pose):
    """Computes :func:`compute_occluded_fractions` from the samples."""
    seen = _samples(ends, radii, depth, owner, mine, camera, pose)
    count, hidden, inside = seen.shape[1], 0, 0
    for n in range(count):
        inside += seen[0, n]
        hidden += seen[1, n] & (not seen[2, n])
    return hidden / count, 1.0 - inside / count
