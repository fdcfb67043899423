"""Depth images of simple surfaces at known distances, and volumes fused from them."""

import numpy as np

from enliven import rotation
from enliven.camera import Intrinsics, pixel_rays
from enliven.scanning import DepthNoiseModel, DepthPreparation, TsdfVolume, VolumeSettings

CAMERA = Intrinsics(96, 72, 90.0, 90.0, 47.5, 35.5)
EVEN = DepthNoiseModel(quadratic=0.0)
"""Noise model in which depth has the same weight at every distance."""
SETTINGS = VolumeSettings(voxel=0.02, noise=EVEN, reach=5.0)


def prepared(depth, camera=CAMERA, settings=SETTINGS, colour=None):
    """Returns the view of a depth image (H, W) in metres, which is inf where nothing is hit."""
    millimetres = np.where(np.isfinite(depth), depth * 1000.0, 0.0).astype(np.float32)
    return DepthPreparation(camera, settings.noise, settings.near, settings.far).prepare(millimetres, colour)


def plane_depth(normal, distance, pose, camera=CAMERA):
    """Returns (H, W) metres to the plane normal . x = distance (world)."""
    ray = np.concatenate([pixel_rays(camera), np.ones((camera.height, camera.width, 1))], -1) @ pose[:3, :3].T
    with np.errstate(divide="ignore"):
        depth = (distance - normal @ pose[:3, 3]) / (ray @ normal)
    return np.where(depth > 0, depth, np.inf)


def sphere_depth(centre, radius, pose, camera=CAMERA):
    """Returns (H, W) metres to the first intersection with a sphere, inf for rays that miss it."""
    ray = np.concatenate([pixel_rays(camera), np.ones((camera.height, camera.width, 1))], -1)
    to = pose[:3, :3].T @ (np.asarray(centre, float) - pose[:3, 3])
    a, b, c = (ray * ray).sum(-1), ray @ to, to @ to - radius**2
    under = b * b - a * c
    return np.where(under > 0, (b - np.sqrt(np.maximum(under, 0))) / a, np.inf)


def looking(angle, distance=1.0, tilt=0.0):
    """Returns (4, 4) the pose of a camera on a horizontal circle about the origin, which it looks at."""
    pose = np.eye(4)
    turn = rotation.to_matrix(rotation.from_rotation_vector([0.0, angle, 0.0]))
    turn = turn @ rotation.to_matrix(rotation.from_rotation_vector([tilt, 0.0, 0.0]))
    pose[:3, :3] = turn
    pose[:3, 3] = -distance * turn[:, 2]
    return pose


def fused_sphere(radius=0.25, count=8, settings=SETTINGS, move=None):
    """Returns the fusion of views of a sphere about the origin from all sides. ``move`` (4, 4) transforms the
    world.
    """
    volume, move = TsdfVolume(settings), np.eye(4) if move is None else move
    poses = [looking(2 * np.pi * k / count) for k in range(count)]
    poses += [looking(0.0, tilt=1.4), looking(0.0, tilt=-1.4)]
    for pose in poses:
        view = prepared(sphere_depth((0, 0, 0), radius, pose), settings=settings)
        volume.allocate(view, move @ pose)
    for pose in poses:
        view = prepared(sphere_depth((0, 0, 0), radius, pose), settings=settings)
        volume.integrate(view, move @ pose)
    return volume
