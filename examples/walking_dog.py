"""Let a dog walk as a person walks: walking_dog.py [DOG.glb], with the dog that rigged_dog.py makes."""

import sys
from dataclasses import replace

import numpy as np

from enliven import clip_of_bodies, read_gltf, retarget
from enliven_synthesis.sensor.profile import load_profile
from enliven_synthesis.sensor.studio import SyntheticSettings, SyntheticStudio
from enliven_viewer.film.project_film import write_project_film

# The person is simulated. `enliven track` finds a real one in depth images.
seconds = np.arange(0.0, 5.6, 1 / 30)
studio = SyntheticStudio(load_profile("kinect1"), SyntheticSettings(choreography="walk"))
walk = clip_of_bodies([studio.body(round(1e9 * time)) for time in seconds], seconds, "walk")

model = read_gltf(*(sys.argv[1:] or ["rigged_dog.glb"]), height=1.25, floor=True)
mesh = model.shape.mesh
paws = mesh.vertices[:, 1:2] < 0.2
coat = np.where(paws, np.uint8([235, 220, 195]), np.uint8([176, 108, 58]))
retargeted = retarget(replace(model.shape, mesh=replace(mesh, colours=coat, materials=None)), walk)
for chain in retargeted.plan.chains:
    print(f"{chain.source} -> {chain.target}")

# The person is drawn in front of the dog, and walks on the spot too: the hip keeps its place on the floor.
times = np.arange(0.4, 2.8, 0.04)
people = [studio.body(round(1e9 * time)) for time in times]
places = [np.array([0.0, 0.0, 1.45]) - person.joints[0] * [1, 0, 1] for person in people]
bodies = [[replace(body, joints=body.joints + place)] for body, place in zip(people, places, strict=True)]
film = "walking_dog.webp"
write_project_film(film, retargeted.project, times, bodies=bodies, azimuth=62.0, look="garden")
