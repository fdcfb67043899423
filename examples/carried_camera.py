"""Record a simulated depth camera that is carried around a chair: carried_camera.py [-o CARRIED.mcap]"""

import sys

from enliven import Recorder, fit_height, load_sample
from enliven_synthesis.sensor.handheld import HandheldPath, HandheldScan
from enliven_synthesis.sensor.profile import load_profile

path = sys.argv[2] if sys.argv[1:2] == ["-o"] else "carried.mcap"
walk = HandheldPath(target=(0.0, 0.5, 0.0), radius=1.5, height=(0.7, 1.3), turns=1.0, seconds=12.0)
chair = fit_height(load_sample("chair"), 1.1)
camera = HandheldScan(chair, load_profile("kinect1"), walk, width=320, colour=True)
numbers = range(0, camera.frames, 3)
with Recorder(path) as recorder:
    for number in numbers:
        recorder.write_frame(camera.frame(number))
print(f"{path}: {len(numbers)} frames")
print(f"once around in {walk.seconds:.0f} s, {walk.radius} m away")
print(f"{walk.height[0]} to {walk.height[1]} m above the floor")
