"""Scan a chair with a camera that is carried around it, and possess the scan."""

from enliven import Recording, fit_height, load_sample, possess, save_mesh
from enliven.possession import ActorSettings
from enliven.scanning import Scanner, ScanSettings, ScanState, VolumeSettings
from enliven_edge.assets import CHAIR
from enliven_synthesis.sensor import HandheldPath, HandheldScan, load_profile
from enliven_viewer.film import write_project_sheet

# This camera is simulated. Record a real one with `enliven record`, and read it with
# Recording("FILE.mcap").frames().
path = HandheldPath(target=(0.0, 0.5, 0.0), radius=1.5, height=(0.7, 1.3), turns=1.0, seconds=8.0)
carried = HandheldScan(
    fit_height(load_sample("chair"), 1.1), load_profile("kinect1"), path, width=320, colour=True
)

scanner = Scanner(ScanSettings(volume=VolumeSettings(voxel=0.01)))
states = [scanner.add(carried.frame(number)).state for number in range(0, carried.frames, 3)]
print(f"{len(states)} images, {states.count(ScanState.LOST)} of them not used")
scan = scanner.thing()
save_mesh(scan, "scan_and_possess.glb")

performer = [frame.bodies[0] for frame in Recording(CHAIR).truth()][60:150]
project, _ = possess(fit_height(scan, 1.75), performer, settings=ActorSettings())
write_project_sheet("scan_and_possess.png", project, [0.0, 0.8, 1.6, 2.4], "A scan that came alive")
