"""Tests that motions, settings and meshes from untrusted sources are refused in a sentence, whatever their
headers state.
"""

import struct

import numpy as np
import pytest
from bounded import bounded

from enliven.document.example_settings import ExampleSettings
from enliven.errors import InputError
from enliven.example_sessions.session import read_session
from enliven.formats.motion.bvh import parse_bvh
from enliven.mapping.plan_file import read_plan
from enliven.meshes.files import load_mesh
from enliven.settings import load_settings

PLY = b"ply\nformat ascii 1.0\n"
PCD = b"FIELDS x y z\nSIZE 4 4 4\nTYPE F F F\n"


def read_settings(path):
    return load_settings(ExampleSettings, path)


def nested_bvh(count: int) -> str:
    """Returns nested joints, each the child of the previous one. The root rotates about X."""
    root = "ROOT r\n{\nOFFSET 0 1 0\nCHANNELS 1 Xrotation\n"
    joints = "".join(f"JOINT j{k}\n{{\nOFFSET 0 1 0\nCHANNELS 0\n" for k in range(count - 1))
    return f"HIERARCHY\n{root}{joints}" + "}\n" * count + "MOTION\nFrames: 1\nFrame Time: 0.01\n0\n"


def flat_bvh(count: int, frames: int, name: str = "j{}") -> str:
    """Returns a root with ``count`` children that do not rotate."""
    inside = "".join(f"JOINT {name.format(k)}\n{{\nOFFSET 0 1 0\n}}\n" for k in range(count))
    head = f"HIERARCHY\nROOT r\n{{\nOFFSET 0 0 0\nCHANNELS 1 Xrotation\n{inside}}}\nMOTION\n"
    return head + f"Frames: {frames}\nFrame Time: 0.01\n" + "0\n" * frames


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (nested_bvh(5000), "deeper than 256"),
        (flat_bvh(5000, 1, "same"), "more than 4096"),
        (flat_bvh(4000, 100_000), "more than 4193 frames"),
        (nested_bvh(2).replace("Frames: 1", "Frames: ²"), "Frames"),
        (nested_bvh(2).replace("CHANNELS 0", "CHANNELS ²"), "CHANNELS"),
        (nested_bvh(2).replace("Frames: 1", "Frames: " + "9" * 5000), "Frames"),
    ],
    ids=["nested", "alike", "frames", "digit", "channels", "digits"],
)
def test_a_motion_that_no_body_does_is_refused(text, words):
    with bounded(300, 20), pytest.raises(InputError, match=words):
        parse_bvh(text)


@pytest.mark.parametrize(
    "text",
    [
        "a = " + "[" * 100_000,
        "a = " + "{a=" * 100_000,
        "a" + ".a" * 100_000 + " = 1",
        "a" + ".a" * 4000 + " = 1",
    ],
    ids=["arrays", "tables", "keys", "fewer keys"],
)
@pytest.mark.parametrize("read", [read_plan, read_session, read_settings])
def test_settings_nested_without_end_are_refused(tmp_path, read, text):
    path = tmp_path / "a.toml"
    path.write_text(text)
    with (
        bounded(seconds=20),
        pytest.raises(InputError, match=r"nested in more than 32 levels|a line has") as caught,
    ):
        read(path)
    assert str(path) in caught.value.where


def test_settings_of_a_gigabyte_are_refused(tmp_path):
    with (tmp_path / "a.toml").open("wb") as file:
        file.truncate(1 << 30)
    with bounded(), pytest.raises(InputError, match="but at most"):
        load_settings(ExampleSettings, tmp_path / "a.toml")


@pytest.mark.parametrize(
    ("name", "data", "words"),
    [
        (
            "a.stl",
            bytes(80) + b"\xff" * 4 + bytes(50),
            "declares 4294967295 triangles.*214748364834 bytes.* 134",
        ),
        ("a.stl", b"solid x\nfacet\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nvertex 1", "ends early"),
        ("a.off", b"OFF\n-1 1 0\n0 0 0\n", "-1 vertices"),
        ("a.mesh", b"MeshVersionFormatted 1\nVertices -5\n0 0 0 0\n", "a negative number of Vertices: -5"),
        (
            "a.ply",
            PLY + b"element vertex 4000000000\nproperty float x\nend_header\n",
            "of the header is not valid",
        ),
        (
            "a.ply",
            PLY + b"" + b"property float x\n" * 1000 + b"end_header\n",
            "1000 properties",
        ),
        (
            "a.obj",
            b"".join(b"usemtl m%d\nf 1 1 1\n" % k for k in range(20_000)),
            "line 2.*vertex 1, but only 0",
        ),
        (
            "a.pcd",
            PCD + b"POINTS 4\nDATA ascii\n0 0 1\n1 0 1\n9e5 9e5 1e5\n9e5 0 1e5\n",
            "cover too large an area",
        ),
        (
            "a.pcd",
            PCD + b"COUNT 1 1 -1\nPOINTS 4\nDATA binary\n" + bytes(48),
            "do not match its header",
        ),
    ],
    ids=["stl", "short stl", "off", "mesh", "ply", "ply properties", "obj", "pcd", "pcd count"],
)
def test_counts_in_a_mesh_header_are_checked(tmp_path, name, data, words):
    path = tmp_path / name
    path.write_bytes(data)
    with bounded(300, 20), pytest.raises(InputError, match=words):
        load_mesh(path)


def test_an_ascii_and_a_binary_stl_are_the_same(tmp_path):
    corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 0], [0, 0, 1], [1, 0, 0]], np.float32)
    lines = ["solid two"]
    for at in (0, 3):
        lines += ["facet normal 0 0 0", "outer loop"]
        lines += [f"vertex {x} {y} {z}" for x, y, z in corners[at : at + 3]] + ["endloop", "endfacet"]
    (tmp_path / "a.stl").write_text("\n".join([*lines, "endsolid two\n"]))
    rows = b"".join(bytes(12) + corners[at : at + 3].tobytes() + bytes(2) for at in (0, 3))
    (tmp_path / "b.stl").write_bytes(b"solid, says a binary file".ljust(80) + struct.pack("<I", 2) + rows)
    a, b = load_mesh(tmp_path / "a.stl").mesh, load_mesh(tmp_path / "b.stl").mesh
    np.testing.assert_array_equal(a.vertices[a.faces], b.vertices[b.faces])
    assert len(a.vertices) == 4
