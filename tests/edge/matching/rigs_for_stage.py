"""A generated star-shaped rig, and people that point in given directions."""

from __future__ import annotations

import numpy as np

from enliven.document.character import SkinWeights
from enliven.document.rigged import RiggedCharacter, still_shape
from enliven.document.skeleton import Skeleton
from enliven.meshes.mesh import Mesh
from enliven.person.body import Body
from enliven.person.joints import Joint

LIMBS = {
    "right": (1.0, 0.0, 0.0),
    "left": (-1.0, 0.0, 0.0),
    "up": (0.0, 1.0, 0.0),
    "lower right": (0.6, -0.8, 0.0),
    "lower left": (-0.6, -0.8, 0.0),
    "front": (0.0, 0.0, 1.0),
}
"""Limb directions by name, seen by a viewer that looks along -Z."""


LEG = (("HIP", 0.05, 0.0), ("KNEE", 0.5, 0.0), ("ANKLE", 0.92, 0.0), ("FOOT", 0.98, 0.15))
"""Joints of a leg: name, metres below the hip centre, metres ahead of it."""


def star() -> RiggedCharacter:
    """Returns a rig with a centre and limbs of two bones, with a thin pyramid of mesh along each bone."""
    names, parents, points = ["middle"], [-1], [np.array([0.0, 1.0, 0.0])]
    vertices, faces, owners = [], [], []
    for name, direction in LIMBS.items():
        for bone in (1, 2):
            names.append(f"{name} {bone}")
            parents.append(0 if bone == 1 else len(points) - 1)
            start, end = points[parents[-1]], points[0] + 0.4 * bone * np.array(direction)
            points.append(end)
            across = np.eye(3)[[int(np.argmin(np.abs(direction)))]] * 0.05
            first = len(vertices)
            vertices += [start, start + across[0], end]
            faces.append([first, first + 1, first + 2])
            owners += [len(points) - 1] * 3
    skeleton = Skeleton(tuple(names), np.array(parents), np.array(points))
    indices = np.zeros((len(owners), 4), np.uint16)
    indices[:, 0] = owners
    weights = np.tile(np.array([1, 0, 0, 0], np.float32), (len(owners), 1))
    mesh = Mesh(np.array(vertices), np.array(faces, np.int32), "star")
    return still_shape("star", skeleton, mesh, SkinWeights(indices, weights))


def person(left=(1.0, 0.0, 0.0), right=(-1.0, 0.0, 0.0), id=1, at=(0.0, 0.0, -2.5)) -> Body:
    """Returns a person that faces +Z with straight arms in the given directions and hanging legs. Left is at
    +X.
    """
    joints = np.zeros((20, 3))
    middle = {"HIP_CENTER": 1.0, "SPINE": 1.15, "SHOULDER_CENTER": 1.45, "HEAD": 1.65}
    for name, height in middle.items():
        joints[Joint[name]] = (0.0, height, 0.0)
    for side, sign, arm in (("LEFT", 1.0, left), ("RIGHT", -1.0, right)):
        arm = np.array(arm) / np.linalg.norm(arm)
        shoulder = joints[Joint.SHOULDER_CENTER] + [0.15 * sign, 0.0, 0.0]
        for name, along in (("SHOULDER", 0.0), ("ELBOW", 0.28), ("WRIST", 0.53), ("HAND", 0.61)):
            joints[Joint[f"{name}_{side}"]] = shoulder + along * arm
        for name, drop, ahead in (
            ("HIP", 0.05, 0),
            ("KNEE", 0.5, 0),
            ("ANKLE", 0.92, 0),
            ("FOOT", 0.98, 0.15),
        ):
            joints[Joint[f"{name}_{side}"]] = (0.1 * sign, 1.0 - drop, ahead)
    return Body(id, joints + np.array(at), np.ones(20))
