"""Generates random rigged models as glTF files, with random builds, proportions, names, orders, roll angles
and root scales.

path = random_rig(7, folder / "7.gltf")     # a model that nothing was tuned on, with a tube for every limb
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[2] / "helpers"))
from gltf_builder import GltfBuilder, trs, unit

SIDES = 8
"""Corners of a tube's cross-section."""
RINGS = 6
"""Cross-sections of a tube for each bone."""
BUILDS = ("human", "horse", "insect", "raptor")
"""Builds of random models: two legs and arms, four legs, six legs, two legs with a level trunk."""
WORDS = ("Bone", "jnt", "def", "ctrl", "rig", "b", "Mesh", "node")
"""Words for meaningless joint names."""


def random_rig(seed: int, path: Path) -> Path:
    """Writes a model of a random build to ``path``. The same seed gives the same model."""
    random = np.random.default_rng(seed)
    limbs = [_split(seed, limb) for limb in _make_limbs(random, BUILDS[seed % len(BUILDS)])]
    gltf, telling = GltfBuilder(), bool(random.random() < 0.5)
    scale = float(10.0 ** random.uniform(-2, 2))
    top = gltf.node(name="Armature", scale=[scale] * 3, rotation=unit(random).tolist())
    base = trs([0, 0, 0], gltf.json["nodes"][top]["rotation"], scale)
    nodes: dict[tuple[str, int], int] = {}
    bind: list[np.ndarray] = []

    def joint(key: tuple[str, int], above: tuple[str, int] | None, place: np.ndarray) -> None:
        world = trs(place, unit(random))
        before = base if above is None else bind[nodes[above]]
        local = np.linalg.inv(before) @ world
        name = f"{key[0]} {key[1]}" if telling else f"{random.choice(WORDS)}_{len(bind):03d}"
        parent = top if above is None else order[nodes[above]]
        order.append(gltf.node(parent, name=name, matrix=local.T.reshape(-1).tolist()))
        nodes[key] = len(bind)
        bind.append(world)

    order: list[int] = []
    trunk, others = limbs[0], limbs[1:]
    for k, place in enumerate(trunk[2]):
        joint((trunk[0], k), (trunk[0], k - 1) if k else None, place)
    for name, fork, places in (others[i] for i in random.permutation(len(others))):
        for k, place in enumerate(places):
            joint((name, k), (name, k - 1) if k else (trunk[0], fork % len(trunk[2])), place)
    _add_tubes(gltf, limbs, nodes, order, bind)
    return gltf.write(path)


def _make_limbs(random: np.random.Generator, build: str) -> list[tuple[str, int, np.ndarray]]:
    """Returns (name, parent joint in the trunk, positions (K, 3) metres) of each limb, the trunk first."""

    def vary(points, by: float = 0.12) -> np.ndarray:
        points = np.array(points, float)
        steps = np.diff(points, axis=0) * random.uniform(1 - by, 1 + by, (len(points) - 1, 1))
        return np.concatenate([points[:1], points[0] + np.cumsum(steps, axis=0)])

    def sided(name: str, fork: int, points) -> list[tuple[str, int, np.ndarray]]:
        places = vary(points)
        return [
            (f"{side} {name}", fork, places * [sign, 1, 1]) for side, sign in (("Left", 1), ("Right", -1))
        ]

    down = float(random.uniform(0, 1.2))
    out = np.array([np.cos(down), -np.sin(down), 0.0])
    at = np.array([0.17, 1.42, 0.0])
    arm = [at, at + 0.28 * out, at + 0.53 * out, at + 0.7 * out]
    leg = [(0.1, 0.92, 0), (0.1, 0.5, 0.01), (0.1, 0.09, -0.02), (0.1, 0.0, 0.14)]
    if build == "human":
        trunk = ("Spine", 0, vary([(0, 0.95, 0), (0, 1.15, 0), (0, 1.35, 0)]))
        top = trunk[2][-1]
        shift = top - [0, 1.35, 0]
        head = (
            "Head",
            -1,
            vary(
                [
                    _offset_point(top, 0, 0.12, 0),
                    _offset_point(top, 0, 0.22, 0.02),
                    _offset_point(top, 0, 0.42, 0.02),
                ]
            ),
        )
        return [trunk, head, *sided("Arm", -1, arm + shift), *sided("Leg", 0, leg)]
    if build == "raptor":
        trunk = ("Spine", 0, vary([(0, 1.0, -0.1), (0, 1.05, 0.2), (0, 1.1, 0.5)]))
        top = trunk[2][-1]
        head = (
            "Neck",
            -1,
            vary(
                [
                    _offset_point(top, 0, 0.1, 0.1),
                    _offset_point(top, 0, 0.3, 0.2),
                    _offset_point(top, 0, 0.3, 0.5),
                ]
            ),
        )
        tail = ("Tail", 0, vary([(0, 1.0, -0.3), (0, 0.95, -0.7), (0, 0.9, -1.1)]))
        arms = sided("Arm", -1, np.array([(0.12, -0.1, 0), (0.14, -0.25, 0.0), (0.14, -0.3, 0.15)]) + top)
        legs = [
            (0.15, 0.95, -0.1),
            (0.16, 0.6, 0.1),
            (0.16, 0.25, -0.15),
            (0.16, 0.0, 0.05),
            (0.16, 0.0, 0.2),
        ]
        return [trunk, head, tail, *arms, *sided("Leg", 0, legs)]
    pairs = 2 if build == "horse" else 3
    trunk = ("Spine", 0, vary([(0, 1.0, -0.6), (0, 1.02, -0.1), (0, 1.0, 0.5)], 0.05))
    top = trunk[2][-1]
    head = (
        "Neck",
        -1,
        vary(
            [
                _offset_point(top, 0, 0.1, 0.1),
                _offset_point(top, 0, 0.45, 0.3),
                _offset_point(top, 0, 0.4, 0.6),
            ]
        ),
    )
    tail = ("Tail", 0, vary([(0, 1.0, -0.75), (0, 0.75, -0.9), (0, 0.5, -0.95)]))
    limbs = [trunk, head, tail]
    for k in range(pairs):
        fork = 2 - k if pairs == 3 else 2 * (1 - k)
        x, y, z = trunk[2][fork] + [0.15, -0.05, 0.0]
        wide = float(random.uniform(0, 0.1)) if pairs == 2 else 0.5
        legs = [(x, y, z), (x + wide, y * 0.6, z + 0.05), (x + wide, y * 0.25, z - 0.05), (x + wide, 0, z)]
        limbs += sided(f"Leg {'ABC'[k]}", fork, legs)
    return limbs


def _offset_point(place: np.ndarray, x: float, y: float, z: float) -> np.ndarray:
    """Returns (3,) a point offset by (x, y, z) metres."""
    return place + np.array([x, y, z])


def _split(seed: int, limb: tuple[str, int, np.ndarray]) -> tuple[str, int, np.ndarray]:
    """Returns the limb, sometimes with one bone split in two (equally on both sides), like the twist bones of
    rigs.
    """
    name, fork, places = limb
    chance = np.random.default_rng([seed, *map(ord, name.split()[-1])])
    if fork >= 0 and chance.random() < 0.4 and name != "Spine":
        k = int(chance.integers(1, len(places)))
        places = np.insert(places, k, (places[k - 1] + places[k]) / 2, axis=0)
    return name, fork, places


def _add_tubes(made: GltfBuilder, limbs, nodes, order, bind) -> None:
    """Adds one mesh with a closed tube for every limb. At a joint, two bones share the surface."""
    vertices, faces, joints, weights = [], [], [], []
    for name, fork, own in limbs:
        keys = [(name, k) for k in range(len(own))]
        places = own
        if name != limbs[0][0]:
            # A limb begins inside the trunk, which moves its first ring.
            keys = [(limbs[0][0], fork % len(limbs[0][2])), *keys]
            places = np.concatenate([limbs[0][2][fork][None], own])
        thick = 0.09 if name in ("Spine", "Neck", "Head") else 0.05
        first = sum(map(len, vertices))
        rings = []
        for k in range(len(places) - 1):
            for u in np.arange(RINGS + (k == len(places) - 2)) / RINGS:
                rings.append((places[k] + u * (places[k + 1] - places[k]), places[k + 1] - places[k]))
                blend = max(0.0, 0.5 - 2.0 * u) if k else 0.0
                after = max(0.0, 2.0 * u - 1.5) if k < len(places) - 2 else 0.0
                pair = k - 1 if blend else k + 1 if after else k
                share = blend or after
                joints += [[nodes[keys[k]], nodes[keys[pair]], 0, 0]] * SIDES
                weights += [[1.0 - share, share, 0, 0]] * SIDES
        angle = np.arange(SIDES) * 2 * np.pi / SIDES
        for centre, way in rings:
            way = way / np.linalg.norm(way)
            side = np.cross(way, [0.3, 0.5, 0.81])
            side /= np.linalg.norm(side)
            up = np.cross(way, side)
            vertices.append(centre + thick * (np.cos(angle)[:, None] * side + np.sin(angle)[:, None] * up))
        for r in range(len(rings) - 1):
            for s in range(SIDES):
                a, b = first + r * SIDES + s, first + r * SIDES + (s + 1) % SIDES
                faces += [[a, b, b + SIDES], [a, b + SIDES, a + SIDES]]
    points = np.concatenate(vertices).astype(np.float32)
    inverse = np.array([np.linalg.inv(m).T.reshape(-1) for m in bind], np.float32)
    skin = made.add("skins", {"joints": order, "inverseBindMatrices": made.accessor(inverse)})
    primitive = {
        "attributes": {
            "POSITION": made.accessor(points),
            "JOINTS_0": made.accessor(np.array(joints, np.uint16)),
            "WEIGHTS_0": made.accessor(np.array(weights, np.float32)),
        },
        "indices": made.accessor(np.array(faces, np.uint32).reshape(-1, 1)),
    }
    made.node(mesh=made.add("meshes", {"primitives": [primitive]}), skin=skin)
