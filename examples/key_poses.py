"""Pose a cactus for two moments of a motion. Between these key poses it moves with squash and stretch."""

from dataclasses import replace

import numpy as np

from enliven import Recording, cactus_project, clip_of_bodies, fit_examples
from enliven_edge.assets import CHAIR
from enliven_viewer.film.project_film import write_project_film
from enliven_viewer.film.project_sheet import write_project_sheet

frames = list(Recording(CHAIR).truth())[:90]
seconds = [(frame.time_ns - frames[0].time_ns) / 1e9 for frame in frames]
take = clip_of_bodies([frame.bodies[0] for frame in frames], seconds, "take")

cactus = cactus_project().puppets["cactus"].mesh
top, pot = int(cactus.vertices[:, 1].argmax()), int(cactus.vertices[:, 1].argmin())
rest = cactus.vertices[[top, pot]]
bowed = rest + np.array([[0.0, -0.25, 0.35], [0.0, 0.0, 0.0]])
# Each control point has a vertex and the joint of the performer that it follows.
points = {"top": (top, "head"), "pot": (pot, "hip center")}
project, _ = fit_examples(cactus, take, points, {0.0: rest, 2.6: bowed})

write_project_sheet("key_poses.png", project, [0.0, 1.3, 2.2, 2.6], "A cactus with two key poses")
# The performer is drawn next to the cactus.
times = np.arange(0.88, 2.88, 0.04)
performers = [frames[round(30 * time)].bodies[0] for time in times]
place = np.array([0.75, 0.0, 2.0])
bodies = [[replace(body, joints=body.joints + place)] for body in performers]
write_project_film("key_poses.webp", project, times, bodies=bodies)
