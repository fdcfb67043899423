"""Let three chairs dance in canon: copies of one chair that play later."""

import numpy as np

from enliven import Recording, copy, load_sample, possess
from enliven.possession import ActorSettings
from enliven_edge.assets import CHAIR
from enliven_viewer.film.project_film import write_project_film
from enliven_viewer.film.project_sheet import write_project_sheet

dance = [frame.bodies[0] for frame in Recording(CHAIR).truth()][46:114]
# The dance ends as it begins, so it can be repeated.
project, first = possess(load_sample("chair"), [*dance, *dance], settings=ActorSettings())
for number in (1, 2):
    project, _ = copy(project, first, offset=[1.1 * number, 0.0, 0.0], delay=0.4 * number)

write_project_sheet("canon.png", project, [0.4, 1.2, 1.6, 2.0], "A canon of chairs")
write_project_film("canon.webp", project, np.arange(0.8, 3.05, 1 / 16), rate=16, elevation=8.0)
