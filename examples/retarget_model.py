"""Retarget the motion of another skeleton to a rigged model: retarget_model.py TAKE.bvh MODEL.glb"""

import sys

import numpy as np

from enliven import export, read_gltf, read_take, retarget
from enliven_viewer.film.project_sheet import write_project_sheet

take, notes = read_take(sys.argv[1])
model = read_gltf(sys.argv[2], height=1.6, floor=True)
print(*notes, *model.notes, sep="\n")

retargeted = retarget(model.shape, take)
for chain in retargeted.plan.chains:
    print(f"{chain.source} -> {chain.target}")
export(retargeted.project, "retarget_model.glb")
times = [float(time) for time in np.linspace(0.0, retargeted.duration, 4)]
write_project_sheet("retarget_model.png", retargeted.project, times, "A model that moves by a take")
