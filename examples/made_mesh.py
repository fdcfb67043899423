"""Create a mesh from numbers, a ring on four legs, and possess it."""

import numpy as np
import trimesh

from enliven import Mesh, Recording, fit_height, possess, save_mesh
from enliven.possession import ActorSettings
from enliven_edge.assets import CHAIR
from enliven_viewer.film.project_sheet import write_project_sheet

pieces = [trimesh.creation.torus(0.35, 0.12)]
for x, z in ((-0.35, 0.0), (0.35, 0.0), (0.0, -0.35), (0.0, 0.35)):
    pieces.append(trimesh.creation.cylinder(0.08, height=0.9).apply_translation([x, z, -0.45]))
solid = trimesh.boolean.union(pieces, engine="manifold").subdivide_to_size(0.08)
upright = solid.vertices @ np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
ring = fit_height(Mesh(upright, solid.faces.astype(np.int32), "ring"), 1.6)
save_mesh(ring, "made_mesh.glb")

performer = [frame.bodies[0] for frame in Recording(CHAIR).truth()][60:150]
project, _ = possess(ring, performer, settings=ActorSettings())
write_project_sheet("made_mesh.png", project, [0.0, 0.8, 1.6, 2.4], "A mesh made from numbers")
