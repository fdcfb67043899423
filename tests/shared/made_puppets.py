"""An upright bean, a performer with hands and a head, and examples that map the performer to the bean."""

import numpy as np

from enliven.document.clip import Clip
from enliven.document.project import Project
from enliven.document.puppet import ControlPoint, ExampleCharacter, KeyPose, PuppetLayer
from enliven.document.skeleton import Skeleton
from enliven.meshes.mesh import Mesh
from enliven.rotation import from_rotation_vector

NAMES = ("hips", "head", "left", "right")


def tube(rings=20, around=12, height=1.0, radius=0.15):
    """Returns a closed tube with round ends on y = 0. The lowest vertex is the first, the highest the
    last.
    """
    angles = np.linspace(0, 2 * np.pi, around, endpoint=False)
    lean = np.linspace(0, np.pi, rings + 2)[1:-1]
    y = height / 2 * (1 - np.cos(lean))
    wide = radius * np.sin(lean) ** 0.5
    rows = [[w * np.cos(a), h, w * np.sin(a)] for h, w in zip(y, wide, strict=True) for a in angles]
    vertices = np.array([[0.0, 0.0, 0.0], *rows, [0.0, height, 0.0]])
    faces, top = [], len(vertices) - 1
    for k in range(around):
        after = (k + 1) % around
        faces.append([0, 1 + k, 1 + after])
        faces.append([top, top - around + after, top - around + k])
        for ring in range(rings - 1):
            a, b = 1 + ring * around + k, 1 + ring * around + after
            faces += [[a, a + around, b], [b, a + around, b + around]]
    return Mesh(vertices, np.array(faces, np.int32), "tube")


def take(frames=25, step=0.1, seed=0):
    """Returns a person that bends, waves and sways."""
    rest = np.array([[0, 1.0, 0], [0, 1.7, 0], [0.6, 1.4, 0], [-0.6, 1.4, 0]])
    skeleton = Skeleton(NAMES, np.array([-1, 0, 0, 0]), rest)
    rng = np.random.default_rng(seed)
    t = np.arange(frames)[:, None, None] * step
    turns = 0.5 * np.sin(t * rng.uniform(1, 4, (4, 1)) + rng.uniform(0, 6, (4, 3)))
    turns[:, 0] *= 0.2
    sway = 0.1 * np.sin(t[:, 0] * [1.0, 2.0, 1.5])
    return Clip("dance", skeleton, from_rotation_vector(turns), rest[0] + sway, step)


def points_of(mesh):
    """Returns the control points: the foot, the top and both sides."""
    middle = np.abs(mesh.vertices[:, 1] - 0.6)
    sides = [int(np.argmin(middle - 2 * s * mesh.vertices[:, 0])) for s in (1, -1)]
    return (
        ControlPoint("foot", 0, "hips", foot=True),
        ControlPoint("top", len(mesh.vertices) - 1, "head"),
        ControlPoint("near", sides[0], "left"),
        ControlPoint("far", sides[1], "right"),
    )


def puppet(name="bean", mesh=None, layers=(PuppetLayer("dance", travel=False),), **changes):
    """Returns a puppet that bends to both sides and is squashed, at three moments of the dance."""
    mesh = tube() if mesh is None else mesh
    points = points_of(mesh)
    rest = mesh.vertices[[point.vertex for point in points]]
    bent = [rest.copy() for _ in range(3)]
    bent[0] += [[0, 0, 0], [0.35, -0.1, 0.05], [0.12, -0.05, 0], [0.12, 0.03, 0]]
    bent[1] += [[0, 0, 0], [-0.3, -0.1, 0], [-0.1, 0.03, 0.05], [-0.1, -0.05, 0]]
    bent[2] += [[0, 0, 0], [0, -0.3, 0.1], [0.06, -0.15, 0], [-0.06, -0.15, 0]]
    poses = tuple(KeyPose("dance", time, places) for time, places in zip((0.2, 1.1, 2.0), bent, strict=True))
    return ExampleCharacter(name, mesh, points, poses, layers, **changes)


def project(**changes):
    """Returns a project with the bean and its take."""
    return Project().with_takes(take()).with_characters(puppet(**changes))
