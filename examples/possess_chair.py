"""Possess a chair with a performer, and save it as a project, a GLB and a film."""

import numpy as np

from enliven import Recording, export, load_sample, possess, write_project
from enliven.possession import ActorSettings
from enliven_edge.assets import CHAIR
from enliven_viewer.film.project_film import write_project_film
from enliven_viewer.film.project_sheet import write_project_sheet

performer = [frame.bodies[0] for frame in Recording(CHAIR).truth()][46:136]
# These settings move the chair to the performer; without them it stays in its modelled position.
project, chair = possess(load_sample("chair"), performer, settings=ActorSettings())

write_project("possess_chair.enliven", project)  # opens in the studio
export(project, "possess_chair.glb")  # opens in Blender and other programs

times = [0.0, 0.8, 1.6, 2.4]
bodies = [performer[round(30 * time)] for time in times]
write_project_sheet("possess_chair.png", project, times, "A chair with a performer in it", bodies=bodies)
# The performer stands upright after 2.28 s, as in the first frame, so the film loops.
times = np.arange(0.0, 2.28, 0.04)
bodies = [[performer[round(30 * time)]] for time in times]
write_project_film("possess_chair.webp", project, times, bodies=bodies)
