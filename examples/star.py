"""Pose a star for four moments of a motion: it waves, squashes and leaps with the performer."""

import numpy as np
import trimesh

from enliven import Mesh, Recording, clip_of_bodies, fit_examples
from enliven_edge.assets import CHAIR
from enliven_viewer.film.project_film import write_project_film

# The star is made of five arms, each the hull of a large and a small ball, and of two dark balls, its eyes.
angles = np.radians([90, 18, 162, -54, -126])
tips = 0.6 * np.c_[np.cos(angles), np.sin(angles), np.zeros(5)] + [0.0, 0.58, 0.0]
ball = trimesh.creation.icosphere(2).vertices
ends = [np.concatenate([0.24 * ball + [0.0, 0.6, 0.0], 0.07 * ball + tip]) for tip in tips]
pieces = [trimesh.PointCloud(points).convex_hull for points in ends]
eyes = [trimesh.creation.icosphere(2, 0.05).apply_translation([x, 0.68, 0.205]) for x in (-0.09, 0.09)]
solid = trimesh.boolean.union(pieces + eyes, engine="manifold").subdivide_to_size(0.08)
dark = np.linalg.norm(np.abs(solid.vertices) - [0.09, 0.68, 0.205], axis=1) < 0.051
colours = np.where(dark[:, None], np.uint8([30, 28, 36]), np.uint8([240, 170, 50]))
star = Mesh(solid.vertices, solid.faces.astype(np.int32), "star", colours)

frames = list(Recording(CHAIR).truth())[160:240]
take = clip_of_bodies([frame.bodies[0] for frame in frames], np.arange(80) / 30, "take")
joints = ["head", "hand left", "hand right", "foot left", "foot right", "spine"]
places = [*tips, [0.0, 0.58, 0.24]]
vertices = [int(np.linalg.norm(star.vertices - place, axis=1).argmin()) for place in places]
rest = star.vertices[vertices]
waving = rest.copy()
waving[1:3] += [[-0.08, 0.3, 0.0], [0.08, 0.3, 0.0]]
squashed, leaping = rest * [1.2, 0.75, 1.0], rest * [0.85, 1.15, 1.0] + [0.0, 0.2, 0.0]
points = {joint: (vertex, joint) for joint, vertex in zip(joints, vertices, strict=True)}
moments = {0.1: rest, 0.63: waving, 1.5: squashed, 1.87: leaping}
project, _ = fit_examples(star, take, points, moments)
write_project_film("star.webp", project, np.arange(0.16, 2.48, 0.04), azimuth=15.0, look="dawn")
