"""Let two performers dance as one table: one moves the front legs, the other one the back legs."""

from dataclasses import replace

import numpy as np
import trimesh

from enliven import Mesh, Recording, possess
from enliven.document import HoldChange
from enliven.frames import BodyFrame
from enliven.motion_clips.body_takes import body_take_from_frames
from enliven_edge.assets import CHAIR
from enliven_viewer.film.project_film import write_project_film

pieces = [trimesh.creation.box((0.7, 0.09, 2.0)).apply_translation([0.0, 0.95, 0.0])]
for x, z in ((-0.2, -0.7), (0.2, -0.7), (-0.2, 0.7), (0.2, 0.7)):
    pieces.append(trimesh.creation.cylinder(0.06, segment=[[x, 0.0, z], [x, 0.95, z]]))
solid = trimesh.boolean.union(pieces, engine="manifold").subdivide_to_size(0.07)
cloth = solid.vertices[:, 1:2] > 0.9
colours = np.where(cloth, np.uint8([198, 62, 54]), np.uint8([222, 180, 120]))
table = Mesh(solid.vertices, solid.faces.astype(np.int32), "table", colours)

# The dance ends as it begins. The second performer is half of it ahead.
dance = [frame.bodies[0] for frame in Recording(CHAIR).truth()][46:114]
frames = []
for number in range(len(dance)):
    front, back = dance[number], dance[(number + 34) % len(dance)]
    pair = [
        replace(front, id=1, joints=front.joints + np.array([0.0, 0.0, 3.4])),
        replace(back, id=2, joints=back.joints + np.array([0.0, 0.0, 2.0])),
    ]
    frames.append(BodyFrame(pair, round(1e9 * number / 30), "made"))

holds = [HoldChange(0.0, 1, "legs"), HoldChange(0.0, 2, "legs", "join")]
project, _ = possess(table, body_take_from_frames(frames, "dance"), holds=holds)
times = np.arange(0.0, 2.25, 0.05)
bodies = [frames[round(30 * time)].bodies for time in times]
write_project_film("two_performers.webp", project, times, bodies=bodies, rate=20, azimuth=50.0, reveal=0.0)
