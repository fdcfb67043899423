"""Tests of the web page that contains a take (.html)."""

from __future__ import annotations

import base64
import gzip
import re
import subprocess
import sys

import made_puppets
import msgspec
import numpy as np
import pytest
from made_bodies import man, random_motion, shape_with_markers

from enliven.deformation.skinning import skin_vertices
from enliven.document import Project
from enliven.errors import InputError
from enliven.exporters import exporter_of, html_page, sample_performance
from enliven.formats.rig.rig import play_clip
from enliven.wire import CharacterMessage, PoseCodec, message_to_character


@pytest.fixture(scope="module")
def walk():
    shape = shape_with_markers("man", man())
    clip = random_motion(np.random.default_rng(1), shape.skeleton, name="walk")
    return sample_performance(play_clip(Project(), shape, clip)[0], "man", rate=20.0)


def save(path, performances, title="walk", **options):
    exporter_of(path, **options).save(path, performances, title, **options)
    return path.read_text(encoding="utf-8")


def take_of(page):
    packed = re.search(r'<script id="take" type="text/plain">([A-Za-z0-9+/=]*)</script>', page)[1]
    return msgspec.msgpack.decode(gzip.decompress(base64.b64decode(packed)))


def decoded(track):
    """Returns the character and the (T, V, 3) surfaces of a track."""
    character = message_to_character(msgspec.msgpack.decode(track["payload"], type=CharacterMessage))
    codec = PoseCodec(character)
    poses = [codec.decode(pose) for pose in track["poses"]]
    return character, [
        skin_vertices(character, made_pose(character, linear, positions)) for linear, positions in poses
    ]


def made_pose(character, linear, positions):
    from enliven.document import Pose

    return Pose(character.id, 0, linear, positions)


def test_page_contains_every_frame_within_the_error_of_the_wire(walk, tmp_path):
    take = take_of(save(tmp_path / "walk.html", [walk]))
    assert take["title"] == "walk" and take["seconds"] == pytest.approx(walk.times[-1])
    (track,) = take["characters"]
    np.testing.assert_array_equal(np.frombuffer(track["times"], "<f8"), walk.times)
    character, surfaces = decoded(track)
    assert character.id == "man"
    assert len(surfaces) == len(walk.times)
    for surface, expected in zip(surfaces, walk.surfaces(), strict=True):
        # Half a quantisation step of rotation and stretch at 0.7 m from a pivot, see enliven.wire.quantize.
        assert np.abs(surface - expected).max() < 3e-3


def test_puppet_is_baked_to_transforms(tmp_path):
    project = made_puppets.project()
    performance = sample_performance(project, "bean", rate=10.0)
    _, surfaces = decoded(take_of(save(tmp_path / "bean.html", [performance]))["characters"][0])
    for surface, expected in zip(surfaces, performance.surfaces(), strict=True):
        assert np.abs(surface - expected).max() < 3e-3


def test_page_needs_nothing_from_outside(walk, tmp_path):
    page = save(tmp_path / "walk.html", [walk])
    markup = re.sub(r"<script>.*</script>|<style>.*</style>|<!--.*?-->", "", page, flags=re.DOTALL)
    assert "src=" not in markup.replace('src="data:', "") and "http" not in markup
    assert [link for link in re.findall(r'href="([^"]*)"', markup) if link != "data:,"] == []
    assert page.count("</script>") == page.count("<script") == 2
    assert "three.js authors" in page


def test_title_is_text_and_not_markup(walk, tmp_path):
    page = save(tmp_path / "walk.html", [walk], "<script>alert(1)</script>")
    assert "<title>&lt;script&gt;alert(1)&lt;/script&gt; · enliven</title>" in page
    assert page.count("</script>") == 2


def test_equal_takes_give_equal_files(walk, tmp_path):
    assert save(tmp_path / "a.html", [walk]) == save(tmp_path / "b.html", [walk])


def test_characters_of_one_name_and_with_long_names_stay_apart(walk, tmp_path):
    from dataclasses import replace

    long = replace(walk, name="x" * 80)
    tracks = take_of(save(tmp_path / "all.html", [walk, walk, long, long]))["characters"]
    names = [decoded(track)[0].id for track in tracks]
    assert names == ["man 1", "man 2", "x" * 62 + " 3", "x" * 62 + " 4"]


def test_scale_is_applied(walk, tmp_path):
    (track,) = take_of(save(tmp_path / "twice.html", [walk], scale=2.0))["characters"]
    np.testing.assert_allclose(decoded(track)[0].vertices, 2 * walk.mesh.vertices, rtol=1e-5)


def test_too_large_a_page_is_refused_and_the_old_file_stays(walk, tmp_path, monkeypatch):
    path = tmp_path / "walk.html"
    path.write_text("old")
    monkeypatch.setattr(html_page, "MAX_PAGE_MB", 0)
    with pytest.raises(InputError, match=r"larger than 0 MB.*--rate"):
        save(path, [walk])
    assert path.read_text() == "old" and list(tmp_path.iterdir()) == [path]


def test_stopped_export_leaves_the_old_file(walk, tmp_path):
    path = tmp_path / "walk.html"
    path.write_text("old")

    def stop(share):
        if share > 0.5:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        exporter_of(path).save(path, [walk], "walk", progress=stop)
    assert path.read_text() == "old" and list(tmp_path.iterdir()) == [path]


@pytest.mark.slow
def test_exporter_loads_no_viewer():
    code = (
        "import sys, enliven.exporters.html_page as m; m.HTML; print(any('viewer' in n for n in sys.modules))"
    )
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True).stdout == "False\n"
