"""Write a sample mesh as a file, chosen by the file's name: sample_mesh.py [-o CACTUS.obj]"""

import sys
from pathlib import Path

import numpy as np

from enliven import load_sample, save_mesh

path = Path(sys.argv[2] if sys.argv[1:2] == ["-o"] else "cactus.obj")
mesh = load_sample(path.stem.lower())  # chair, lamp or cactus
save_mesh(mesh, path)
width, height, depth = np.ptp(mesh.vertices, axis=0)
print(f"{path}: {len(mesh.vertices)} vertices, {len(mesh.faces)} triangles")
print(f"{height:.2f} m tall")
print(f"{width:.2f} m wide and {depth:.2f} m deep")
