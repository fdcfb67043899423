"""Cut a leg off a chair while the chair dances: the leg keeps its motion, goes for a walk, and comes back."""

import numpy as np

from enliven import PlaneCut, Recording, cut, load_sample, possess
from enliven.modeling.edits import move_character
from enliven.possession import ActorSettings
from enliven_edge.assets import CHAIR
from enliven_viewer.film.project_film import write_project_film

performer = [frame.bodies[0] for frame in Recording(CHAIR).truth()][46:118]
whole, chair = possess(load_sample("chair"), performer, settings=ActorSettings())

# This plane separates the front left leg, below the seat, from the rest.
plane = PlaneCut(point=[0.2, 0.66, -2.15], normal=[1.0, -0.6, 1.0])
parts, (_, leg) = cut(whole, chair, plane, time=0.0)

times = np.arange(0.0, 2.28, 0.04)
away = np.sin(np.pi * np.clip((times - 0.3) / 1.8, 0.0, 1.0)) ** 2
hops = 0.12 * np.abs(np.sin(4 * np.pi * away))
projects = [
    move_character(parts, leg, [0.75 * far, high, 0.25 * far]) if far else whole
    for far, high in zip(away, hops, strict=True)
]
write_project_film("cut_leg.webp", projects, times, azimuth=25.0, elevation=10.0)
