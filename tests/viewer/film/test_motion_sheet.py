"""Tests of the contact sheet of a motion: performer above, model below, both moving and completely
visible.
"""

import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from enliven.mapping.automatic_mapping import retarget
from enliven_viewer.film.motion_sheet import make_stick_shape, write_motion_sheet

sys.path.insert(0, str(Path(__file__).parents[2] / "shared" / "mapping"))
from made_bodies import horse, man, random_motion

SIZE = 160


@pytest.mark.usefixtures("gl")
def test_both_rows_move_and_are_whole(tmp_path):
    clip = random_motion(np.random.default_rng(1), man(), size=0.5)
    result = retarget(make_stick_shape("horse", horse()), clip)
    path = tmp_path / "new" / "sheet.png"
    write_motion_sheet(path, result, "a man on a horse", frames=3, size=(SIZE, SIZE))
    sheet = np.asarray(Image.open(path).convert("RGB")).astype(int)
    tiles = [
        [sheet[64 + r * (SIZE + 10) :, 10 + c * (SIZE + 10) :][: SIZE - 34, :SIZE] for c in range(3)]
        for r in range(2)
    ]
    for row in tiles:
        drawn = [(t[..., 2] - t[..., 0] > 60) & (t[..., 2] > 130) for t in row]
        for mask in drawn:
            assert 0.005 < mask.mean() < 0.02
            assert not mask[:, [0, -1]].any() and not mask[0].any()
        assert (drawn[0] ^ drawn[-1]).sum() > 1.5 * drawn[0].sum()


def test_a_stick_figure_has_a_piece_for_every_bone():
    shape = make_stick_shape("man", man())
    followed = np.unique(shape.skin.indices[:, 0])
    assert followed.tolist() == list(range(1, len(man())))
    # Every piece surrounds its bone, is equally long, and is little thicker than a sixth of its length.
    for bone in followed:
        points = shape.mesh.vertices[shape.skin.indices[:, 0] == bone]
        start, along = man().positions[man().parents[bone]], man().vectors[bone]
        share = (points - start) @ along / (along @ along)
        assert share.min() == pytest.approx(0) and share.max() == pytest.approx(1)
