"""Let a dancing chair knock over two towers of boxes; this needs the extra "physics"."""

from dataclasses import replace

import numpy as np

from enliven import Recording, load_sample, possess
from enliven.exporters import sample_performance
from enliven.frames import BodyFrame
from enliven.possession import ActorSettings
from enliven_edge.assets import CHAIR
from enliven_edge.physics.playground import Playground
from enliven_edge.physics.settings import PhysicsSettings
from enliven_edge.stage.tick import Tick
from enliven_viewer.film.project_film import write_project_film

performer = [frame.bodies[0] for frame in Recording(CHAIR).truth()][100:240]
project, chair = possess(load_sample("chair"), performer, settings=ActorSettings())
performance = sample_performance(project, chair)

# The towers appear as soon as the performer stands still. A film needs no limit of the computing time.
settings = PhysicsSettings(world="boxes")
settings = replace(settings, engine=replace(settings.engine, budget=0.0))
physics = Playground(settings, [performance.character])
props = []
for number, (body, pose) in enumerate(zip(performer, performance.poses(), strict=False)):
    frame = BodyFrame([body], round(number * 1e9 / 30), "made")
    props.append(physics.step(Tick(frame, [body], [pose], holders=frozenset([body.id]))))
times = np.arange(0.6, 3.6, 0.05)
loose = [props[round(30 * time)] for time in times]
write_project_film("knock_over.webp", project, times, props=loose, rate=20)
