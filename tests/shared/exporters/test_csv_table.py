"""Tests of the table of positions and rotations (.csv)."""

import csv

import made_puppets
import numpy as np
import pytest
from made_bodies import man, random_motion, shape_with_markers

from enliven.document import Project
from enliven.exporters import exporter_of, performance_of_clip, sample_performance
from enliven.formats.rig.rig import play_clip
from enliven.rotation import from_matrix


@pytest.fixture(scope="module")
def walk():
    shape = shape_with_markers("man", man())
    return play_clip(Project(), shape, random_motion(np.random.default_rng(1), shape.skeleton, name="walk"))[
        0
    ]


def rows_of(path):
    with path.open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def test_every_frame_and_joint_has_a_row_with_position_and_rotation(walk, tmp_path):
    path, performance = tmp_path / "walk.csv", sample_performance(walk, "man", rate=20.0)
    exporter_of(path).save(path, [performance], "walk")
    rows, skeleton = rows_of(path), performance.skeleton
    assert len(rows) == len(performance.times) * len(skeleton)
    assert list(rows[0]) == [
        *("character", "frame", "time_s", "part", "parent", "x_m", "y_m", "z_m", "qw", "qx", "qy", "qz"),
        *("stretch_x", "stretch_y", "stretch_z"),
    ]
    for number in (0, 3, len(performance.times) - 1):
        for joint, name in enumerate(skeleton.names):
            row = rows[number * len(skeleton) + joint]
            parent = skeleton.parents[joint]
            assert (row["character"], row["part"]) == ("man", name) and int(row["frame"]) == number
            assert row["parent"] == ("" if parent < 0 else skeleton.names[parent])
            assert float(row["time_s"]) == pytest.approx(performance.times[number], abs=1e-6)
            place = [float(row[f"{axis}_m"]) for axis in "xyz"]
            np.testing.assert_allclose(place, performance.joints[number, joint], atol=1e-6)
            turn = [float(row[f"q{part}"]) for part in "wxyz"]
            assert abs(turn @ from_matrix(performance.linear[number, joint])) == pytest.approx(1.0, abs=1e-5)
            assert row["stretch_x"] == "1.000000"


def test_unit_and_vertical_axis_change_positions_and_their_headings(walk, tmp_path):
    path, performance = tmp_path / "walk.csv", performance_of_clip(walk.takes["walk"])
    exporter_of(path, unit="cm", up="z").save(path, [performance], "walk", unit="cm", up="z")
    row = rows_of(path)[0]
    x, y, z = performance.joints[0, 0]
    np.testing.assert_allclose([float(row[f"{axis}_cm"]) for axis in "xyz"], [100 * x, -100 * z, 100 * y])


def test_parts_of_a_surface_without_skeleton_are_numbered_in_the_world(tmp_path):
    path, shares = tmp_path / "bean.csv", []
    performance = sample_performance(made_puppets.project(), "bean", 0.0, 0.2, 10.0)
    exporter_of(path).save(path, [performance], "bean", progress=shares.append)
    rows, pose = rows_of(path), list(performance.poses())[2]
    last = rows[-len(pose.positions) :]
    assert [row["part"] for row in last] == [f"part {k}" for k in range(len(pose.positions))]
    places = [[float(row[f"{axis}_m"]) for axis in "xyz"] for row in last]
    np.testing.assert_allclose(places, pose.positions, atol=1e-5)
    assert shares == pytest.approx([1 / 3, 2 / 3, 1.0])


def test_interrupted_table_leaves_the_older_file(walk, tmp_path):
    path = tmp_path / "walk.csv"
    path.write_text("older")

    def interrupt(share):
        if share > 0.5:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        exporter_of(path).save(path, [sample_performance(walk, "man")], "walk", progress=interrupt)
    assert path.read_text() == "older" and list(tmp_path.iterdir()) == [path]
