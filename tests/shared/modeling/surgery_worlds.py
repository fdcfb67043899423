"""Random projects for the tests of surgery, and a slow, literal evaluation for comparison."""

from itertools import pairwise

import numpy as np

from enliven.document.clip import Clip
from enliven.document.layers import Layer, Ref, Span
from enliven.document.project import Project
from enliven.document.rigged import RiggedCharacter
from enliven.document.skeleton import Skeleton
from enliven.meshes.mesh import Mesh
from enliven.modeling.skinning.heat_diffusion import bone_heat
from enliven.rotation import IDENTITY, conjugate, from_rotation_vector, multiply, normalized, rotate, slerp


def random_turns(random, *shape, size=1.0):
    """Returns unit quaternions. With ``size`` below 1 they are near the identity."""
    return normalized((1 - size) * IDENTITY + size * random.normal(size=(*shape, 4)))


def random_skeleton(random, count, names="joint"):
    parents = [-1] + [int(random.integers(max(0, j - 3), j)) for j in range(1, count)]
    positions = np.zeros((count, 3))
    for j in range(1, count):
        positions[j] = positions[parents[j]] + random.normal(size=3) + [0.2, 0, 0]
    at = positions + random.normal(size=3)
    return Skeleton(tuple(f"{names} {j}" for j in range(count)), np.array(parents), at)


def random_clip(random, name, count=5, frames=6):
    """Returns a take whose bones rotate considerably between frames, but clearly less than 180 degrees."""
    skeleton = random_skeleton(random, count)
    turns = np.empty((frames, count, 4))
    turns[:] = random_turns(random, count, size=0.3)
    for f in range(1, frames):
        turns[f] = multiply(turns[f - 1], random_turns(random, count, size=0.1))
    root = skeleton.positions[0] + random.normal(size=(frames, 3))
    return Clip(name, skeleton, turns, root, 0.25)


def random_layer(random, name, take):
    end = int(random.integers(1, len(take.skeleton)))
    chain = take.skeleton.path(0, end)
    chain = chain if random.random() < 0.7 else chain[-1:]
    return Layer(
        name,
        take.id,
        tuple(int(j) for j in chain),
        random_turns(random),
        offset=float(random.uniform(-0.5, 0.5)),
        speed=float(random.choice([1.0, 0.5, -1.0, 2.0])),
        loop=bool(random.random() < 0.5),
        weight=float(random.choice([1.0, 0.6])),
        muted=bool(random.random() < 0.1),
        mirrored=bool(random.random() < 0.3),
    )


def random_spans(random, layers):
    shares = random.uniform(0.2, 1.0, int(random.integers(1, 4)))
    spans = []
    for i, share in enumerate(shares / shares.sum()):
        picked = random.permutation(layers)[: int(random.integers(min(i, 1), 3))]
        refs = tuple(Ref(str(layer), *sorted(random.uniform(0, 1, 2).tolist())) for layer in picked)
        fixed = tuple(random_turns(random).tolist()) if i and random.random() < 0.3 else (1.0, 0.0, 0.0, 0.0)
        spans.append(Span(float(share), refs, fixed))
    return tuple(spans)


def random_shape(random, name, layers, count=None):
    count = int(random.integers(2, 9)) if count is None else count
    skeleton = random_skeleton(random, count, f"{name} joint")
    ids = [layer.id for layer in layers]
    spans = tuple(random_spans(random, ids) for _ in range(count))
    travel = str(random.choice(ids)) if random.random() < 0.5 else None
    modeling, place = random_turns(random, count, size=0.4), random.normal(size=3)
    return RiggedCharacter(name, skeleton, modeling, spans, place, travel, layers=tuple(layers))


def random_project(seed, shapes=2):
    """Returns two takes, four layers, and shapes that use them."""
    random = np.random.default_rng(seed)
    takes = [random_clip(random, "walk"), random_clip(random, "wave")]
    layers = [random_layer(random, f"layer {i}", takes[i % 2]) for i in range(4)]
    random_shapes = (random_shape(random, f"shape {i}", layers) for i in range(shapes))
    return Project().with_takes(*takes).with_characters(*random_shapes), random


def straight_shape(name, points, spans, modeling=None, layers=()):
    """Returns a shape with joints along points. ``spans`` has one tuple for each bone; the root stands
    still.
    """
    points = np.array(points, float)
    skeleton = Skeleton(tuple(f"{name} {i}" for i in range(len(points))), np.arange(len(points)) - 1, points)
    modeling = np.tile(IDENTITY, (len(points), 1)) if modeling is None else modeling
    return RiggedCharacter(name, skeleton, modeling, ((Span(),), *spans), np.zeros(3), layers=layers)


def tube(length=4.0, radius=0.3, around=12, along=33):
    """Returns a closed tube from the origin along +x."""
    angles = np.linspace(0, 2 * np.pi, around, endpoint=False)
    ring = radius * np.stack([np.zeros(around), np.cos(angles), np.sin(angles)], 1)
    rings = [ring + np.array([x, 0, 0]) for x in np.linspace(0, length, along)]
    vertices = np.concatenate([*rings, [[0, 0, 0], [length, 0, 0]]])
    faces = []
    for r in range(along - 1):
        for k in range(around):
            a, b = r * around + k, r * around + (k + 1) % around
            faces += [[a, b, a + around], [b, b + around, a + around]]
    last, first = len(vertices) - 1, len(vertices) - 2
    for k in range(around):
        faces.append([first, (k + 1) % around, k])
        end = (along - 1) * around
        faces.append([last, end + k, end + (k + 1) % around])
    return Mesh(vertices, np.array(faces, np.int32), "tube")


def about_z(degrees):
    return from_rotation_vector(np.radians(degrees) * np.array([0.0, 0.0, 1.0]))


def bending_arm():
    """Returns a tube of two bones that a take bends by 60 degrees in a second."""
    skeleton = Skeleton(("shoulder", "hand"), [-1, 0], [[0, 0, 0], [1.0, 0, 0]])
    turns = np.array([[about_z(0), about_z(60 * t)] for t in (0.0, 1.0)])
    bend = Clip("bend", skeleton, turns, np.zeros((2, 3)), 1.0)
    spans = [(Span(1.0, (Ref("bend", 0.0, 0.5),)),), (Span(1.0, (Ref("bend", 0.5, 1.0),)),)]
    layers = (Layer("bend", "bend", (0, 1)),)
    shape = straight_shape("arm", [[0, 0, 0], [2.0, 0, 0], [4.0, 0, 0]], spans, layers=layers)
    mesh = tube()
    shape = shape.with_changes(mesh=mesh, skin=bone_heat(mesh, shape.skeleton))
    return Project().with_takes(bend).with_characters(shape)


def slow_pose(project, shape_id, time):
    """Returns world rotations (N, 4) and joints (N, 3), computed literally as documented, for a travel scale
    of 1.
    """
    shape = project.shapes[shape_id]
    skeleton = shape.skeleton
    turns, joints = [], []
    for j, parent in enumerate(skeleton.parents):
        own = shape.modeling[j]
        for span in shape.spans[j]:
            own = multiply(own, span.before)
            if time is not None:
                begin, end = (
                    slow_product(project, shape, span, 0.0, time),
                    slow_product(project, shape, span, 1.0, time),
                )
                own = multiply(own, multiply(conjugate(begin), end))
        if parent < 0:
            turns.append(own)
            joints.append(skeleton.positions[0] + shape.place)
        else:
            turns.append(multiply(turns[parent], own))
            joints.append(
                joints[parent] + rotate(turns[j], skeleton.positions[j] - skeleton.positions[parent])
            )
    return np.array(turns), np.array(joints)


def slow_product(project, shape, span, u, time):
    """Returns C(u) of a span, the product of its layers' rotations."""
    product = IDENTITY
    for ref in span.refs:
        layer = shape.layer(ref.layer)
        if not layer.muted and layer.weight > 0:
            product = multiply(product, slow_q(project, layer, ref.start + u * (ref.end - ref.start), time))
    return product


def slow_q(project, layer, s, time):
    """Returns q(s, t) of a layer in the target's axes (AniMesh, 5.1)."""
    clip = project.takes[layer.take]
    turns = slow_turns_at(clip, slow_frame(layer, clip, time))
    knots, bones, base = slow_chain(clip.skeleton, layer.chain)
    start = IDENTITY if base is None else turns[base]
    relative, last = [IDENTITY], IDENTITY
    for bone in bones:
        whole = multiply(conjugate(start), turns[bone])
        step = slerp(IDENTITY, multiply(conjugate(last), whole), np.array(layer.weight))
        relative.append(multiply(relative[-1], step))
        last = whole
    k = min(max(int(np.searchsorted(knots, s, side="right")) - 1, 0), len(knots) - 2)
    q = slerp(relative[k], relative[k + 1], np.array((s - knots[k]) / (knots[k + 1] - knots[k])))
    q = q * np.array([1.0, 1.0, -1.0, -1.0]) if layer.mirrored else q
    return multiply(multiply(layer.basis, q), conjugate(layer.basis))


def slow_chain(skeleton, chain):
    if len(chain) == 1:
        return np.array([0.0, 1.0]), [chain[0]], None
    pairs = list(pairwise(chain))
    bones = [b if skeleton.parents[b] == a else a for a, b in pairs]
    arc = np.cumsum([0.0, *(np.linalg.norm(skeleton.positions[a] - skeleton.positions[b]) for a, b in pairs)])
    down = all(skeleton.parents[b] == a for a, b in pairs)
    return arc / arc[-1], bones, chain[0] if down else 0


def slow_frame(layer, clip, time):
    u = (time - layer.offset) * layer.speed + (clip.duration if layer.speed < 0 else 0.0)
    u = u % clip.duration if layer.loop else min(max(u, 0.0), clip.duration)
    return u / clip.step


def slow_turns_at(clip, frame):
    before = min(int(frame), len(clip.turns) - 2)
    return slerp(clip.turns[before], clip.turns[before + 1], np.full(len(clip.skeleton), frame - before))


def angle(a, b):
    """Returns the largest angle in radians between rotations (..., 4)."""
    a, b = np.asarray(a), np.asarray(b)
    # |a - b| is twice the sine of a quarter of the angle. Unlike the arc cosine, this is exact near zero.
    apart = np.minimum(np.linalg.norm(a - b, axis=-1), np.linalg.norm(a + b, axis=-1))
    return float(4 * np.arcsin(np.minimum(apart / 2, 1.0)).max())
