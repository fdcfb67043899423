"""Cut the back off a dancing chair, give the seat a second one in front, and keep all motions."""

from enliven import PlaneCut, Recording, copy, cut, load_sample, merge, possess
from enliven.possession import ActorSettings
from enliven_edge.assets import CHAIR
from enliven_viewer.film.project_sheet import write_project_sheet

performer = [frame.bodies[0] for frame in Recording(CHAIR).truth()][60:150]
project, chair = possess(load_sample("chair"), performer, settings=ActorSettings())

plane = PlaneCut(point=[0.0, 1.05, 0.0], normal=[0.0, 1.0, 0.0])
project, (seat, back) = cut(project, chair, plane, time=0.0)
project, second = copy(project, back, offset=[0.0, -0.05, 0.45])
for part in (back, second):
    project = merge(project, seat, part, time=0.0, loose=True)

write_project_sheet("cut_and_merge.png", project, [0.0, 0.8, 1.6, 2.4], "A chair with two backs")
