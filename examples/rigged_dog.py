"""Make a rigged model from numbers, a dog of capsules with 18 joints: rigged_dog.py [-o DOG.glb]"""

import sys

import numpy as np
import trimesh

from enliven import Mesh, Project, Skeleton, export
from enliven.document import still_shape
from enliven.modeling.skinning.heat_diffusion import bone_heat

# Each joint: its name, the joint before it, its place in metres (+Y up, +Z forward), and a radius.
joints = [
    ("Hips", None, (0.0, 0.62, -0.38), 0.13),
    ("Chest", "Hips", (0.0, 0.66, 0.25), 0.16),
    ("Neck", "Chest", (0.0, 0.88, 0.45), 0.10),
    ("Head", "Neck", (0.0, 0.86, 0.72), 0.07),
    ("Tail", "Hips", (0.0, 0.74, -0.62), 0.04),
    ("TailEnd", "Tail", (0.0, 0.92, -0.82), 0.03),
]
for side, x in (("Left", 0.13), ("Right", -0.13)):
    for front, above, z in (("Front", "Chest", 0.24), ("Back", "Hips", -0.38)):
        joints.append((f"{side}{front}Leg", above, (x, 0.55, z), 0.08))
        joints.append((f"{side}{front}Knee", f"{side}{front}Leg", (x, 0.3, z + 0.04), 0.06))
        joints.append((f"{side}{front}Foot", f"{side}{front}Knee", (x, 0.05, z), 0.05))

names = [name for name, *_ in joints]
parents = np.array([-1 if above is None else names.index(above) for _, above, *_ in joints])
skeleton = Skeleton(tuple(names), parents, np.array([place for *_, place, _ in joints]))
pieces = []
for (_, above, place, radius), parent in zip(joints, parents, strict=True):
    ends = [(place, radius)] if above is None else [(place, radius), joints[parent][2:]]
    balls = [trimesh.creation.icosphere(1, r).apply_translation(p) for p, r in ends]
    pieces.append(trimesh.util.concatenate(balls).convex_hull)
solid = trimesh.boolean.union(pieces, engine="manifold").subdivide_to_size(0.1)
mesh = Mesh(np.asarray(solid.vertices), np.asarray(solid.faces, np.int32), "dog")
path = sys.argv[2] if sys.argv[1:2] == ["-o"] else "rigged_dog.glb"
export(Project().with_characters(still_shape("dog", skeleton, mesh, bone_heat(mesh, skeleton))), path)
print(f"{path}: {len(mesh.vertices)} vertices", *names, sep="\n")
