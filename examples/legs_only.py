"""Move a mesh by the performer's legs only: the lamp keeps its head still."""

from enliven import Recording, load_sample, possess
from enliven.possession import ActorSettings
from enliven_edge.assets import CHAIR
from enliven_viewer.film.project_sheet import write_project_sheet

performer = [frame.bodies[0] for frame in Recording(CHAIR).truth()][60:150]
times = [0.0, 0.8, 1.6, 2.4]
for parts in ("legs", "all"):
    project, _ = possess(load_sample("lamp"), performer, parts=parts, settings=ActorSettings())
    write_project_sheet(f"legs_only_{parts}.png", project, times, f"A lamp that {parts} move")
