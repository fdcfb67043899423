"""Scan a cactus with a camera that is carried around it, and possess the scan."""

from dataclasses import replace

import numpy as np

from enliven import Project, Recording, fit_height, load_sample, possess, save_mesh
from enliven.modeling.puppet.edits import make_puppet
from enliven.scanning import Scanner, ScanSettings, ScanState, VolumeSettings
from enliven_edge.assets import CHAIR
from enliven_synthesis.sensor.handheld import HandheldPath, HandheldScan
from enliven_synthesis.sensor.profile import load_profile
from enliven_viewer.film.project_film import write_project_film
from enliven_viewer.film.project_sheet import write_project_sheet

# This camera is simulated. Record a real one with `enliven record`, and read it with
# Recording("FILE.mcap").frames().
path = HandheldPath(target=(0.0, 0.5, 0.0), radius=1.5, height=(0.7, 1.3), turns=-1.0, seconds=8.0)
cactus = fit_height(load_sample("cactus"), 1.1)
carried = HandheldScan(cactus, load_profile("kinect1"), path, width=320, colour=True)

scanner, states, scans = Scanner(ScanSettings(volume=VolumeSettings(voxel=0.01))), [], []
for number in range(0, carried.frames, 3):
    states.append(scanner.add(carried.frame(number)).state)
    if number % 12 == 9:
        scans.append(scanner.extract_object())
print(f"{len(states)} images, {states.count(ScanState.LOST)} of them not used")
save_mesh(scanner.extract_object(), "scan_and_possess.glb")

# The scan becomes as tall as the performer. The performer stands in it.
*growing, scan = [replace(mesh, vertices=1.6 * mesh.vertices) for mesh in [*scans, scanner.extract_object()]]
performer = [frame.bodies[0] for frame in Recording(CHAIR).truth()][46:136]
performer = [replace(body, joints=body.joints + np.array([0.0, 0.0, 2.7])) for body in performer]
project, _ = possess(scan, performer)
write_project_sheet("scan_and_possess.png", project, [0.0, 0.8, 1.6, 2.4], "A scan that came alive")

projects = [make_puppet(Project(), mesh, "scan") for mesh in growing]
times = [0.0] * len(growing) + [*np.arange(0.0, 2.28, 0.05)]
projects += [project] * (len(times) - len(growing))
write_project_film("scan_and_possess.webp", projects, times, rate=20)
