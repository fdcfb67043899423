"""Rank the limbs of a rigged model by their similarity to a performer's arms: match_limbs.py MODEL.glb"""

import sys

from enliven import Recording, ScreenView, match, read_gltf
from enliven_edge.assets import CHAIR

skeleton = read_gltf(sys.argv[1]).shape.skeleton
body = next(Recording(CHAIR).truth()).bodies[0]
ranking = match(body, skeleton, "arms", view=ScreenView(direction=[0, 0, -1]))
for number, ranked in enumerate(ranking[:5], 1):
    limbs = [" > ".join(skeleton.names[joint] for joint in branch.chain) for branch in ranked.pairs if branch]
    print(f"{number}. {ranked.score:.2f}  {'; '.join(limbs)}")
