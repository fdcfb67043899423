"""Tests of BVH import: forward kinematics matches the file for any channel order, and errors name the
line.
"""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from enliven.errors import InputError
from enliven.formats.motion.bvh import parse_bvh, read_bvh
from enliven.formats.motion.capture import UNITS, guess_unit

ORDERS = ["XYZ", "XZY", "YXZ", "YZX", "ZXY", "ZYX"]


def turned(axis: str, degrees: float) -> np.ndarray:
    """Returns (4, 4) a rotation, computed literally."""
    a = np.radians(degrees)
    c, s = np.cos(a), np.sin(a)
    m = np.eye(4)
    i, j = {"X": (1, 2), "Y": (2, 0), "Z": (0, 1)}[axis]
    m[i, i], m[j, j], m[i, j], m[j, i] = c, c, -s, s
    return m


@st.composite
def skeletons(draw):
    """Draws a tree of joints as (parent, offset, channels), and frames of their channels."""
    count = draw(st.integers(1, 6))
    number = st.floats(-50, 50).map(lambda x: round(x, 3))
    joints = []
    for n in range(count):
        parent = -1 if n == 0 else draw(st.integers(0, n - 1))
        order = draw(st.sampled_from(ORDERS))
        moves = n == 0 or draw(st.booleans())
        channels = ([f"{a}position" for a in "XYZ"] if moves else []) + [f"{a}rotation" for a in order]
        joints.append((parent, [draw(number) for _ in range(3)], channels))
    width = sum(len(c) for _, _, c in joints)
    rows = [[draw(st.floats(-180, 180).map(lambda x: round(x, 3))) for _ in range(width)] for _ in range(2)]
    return joints, rows


def written(joints, rows) -> tuple[str, list[int]]:
    """Returns the text of a BVH file, and the joints in the order of the file."""
    order: list[int] = []

    def block(n: int, depth: int) -> str:
        order.append(n)
        _, offset, channels = joints[n]
        pad, word = "\t" * depth, "ROOT" if n == 0 else "JOINT"
        text = f"{pad}{word} joint{n}\n{pad}{{\n{pad}\tOFFSET {' '.join(map(str, offset))}\n"
        text += f"{pad}\tCHANNELS {len(channels)} {' '.join(channels)}\n"
        below = [k for k, (parent, _, _) in enumerate(joints) if parent == n]
        for k in below:
            text += block(k, depth + 1)
        if not below:
            text += f"{pad}\tEnd Site\n{pad}\t{{\n{pad}\t\tOFFSET 0 1.5 0\n{pad}\t}}\n"
        return text + f"{pad}}}\n"

    tree = block(0, 0)
    starts = np.cumsum([0, *(len(c) for _, _, c in joints)])
    lines = [" ".join(str(v) for n in order for v in row[starts[n] : starts[n + 1]]) for row in rows]
    return (
        f"HIERARCHY\n{tree}MOTION\nFrames:\t{len(rows)}\nFrame Time: .0083333\n" + "\n".join(lines) + "\n",
        order,
    )


def slow_world(joints, row) -> list[np.ndarray]:
    """Returns (4, 4) of every joint, computed one joint and one channel at a time."""
    world: list[np.ndarray] = []
    column = 0
    for parent, offset, channels in joints:
        move, turn = np.eye(4), np.eye(4)
        move[:3, 3] = offset
        for channel in channels:
            if channel.endswith("position"):
                move["XYZ".index(channel[0]), 3] = row[column]
            else:
                turn = turn @ turned(channel[0], row[column])
            column += 1
        local = move @ turn
        world.append(local if parent < 0 else world[parent] @ local)
    return world


@settings(max_examples=60, deadline=None)
@given(skeletons())
def test_poses_match_the_file(made) -> None:
    joints, rows = made
    text, order = written(joints, rows)
    capture = parse_bvh(text)
    real = [n for n, name in enumerate(capture.names) if not name.endswith(" end")]
    assert [capture.names[n] for n in real] == [f"joint{n}" for n in order]
    for f, row in enumerate(rows):
        world = slow_world(joints, row)
        for at, n in zip(real, order, strict=True):
            np.testing.assert_allclose(capture.positions[f, at], world[n][:3, 3], atol=1e-9)
            np.testing.assert_allclose(capture.rotations[f, at], world[n][:3, :3], atol=1e-12)
    for at, name in enumerate(capture.names):
        if name.endswith(" end"):
            parent = capture.parents[at]
            apart = capture.positions[:, at] - capture.positions[:, parent]
            np.testing.assert_allclose(apart, capture.rotations[:, parent] @ [0.0, 1.5, 0.0], atol=1e-9)


SIMPLE = """HIERARCHY
ROOT Hips
{
  OFFSET 0 90 0
  CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation
  End Site
  {
    OFFSET 0 10 0
  }
}
MOTION
Frames: 2
Frame Time: 0.04
0 90 0 0 0 0
1 90 0 90 0 0
"""


def test_simple_file_is_read() -> None:
    capture = parse_bvh(SIMPLE)
    assert capture.names == ("Hips", "Hips end")
    assert (capture.frames, capture.seconds, capture.notes) == (2, 0.04, ())
    np.testing.assert_allclose(capture.positions[1], [[1, 90, 0], [-9, 90, 0]], atol=1e-12)


def test_a_joint_with_two_ends_gives_them_two_names() -> None:
    end = "  End Site\n  {\n    OFFSET 0 10 0\n  }\n"
    assert parse_bvh(SIMPLE.replace(end, 2 * end)).names == ("Hips", "Hips end", "Hips end 2")


def test_windows_line_ends_and_a_byte_order_mark_do_not_matter(tmp_path) -> None:
    path = tmp_path / "a.bvh"
    path.write_bytes(b"\xef\xbb\xbf" + SIMPLE.replace("\n", "\r\n").encode())
    assert read_bvh(path).frames == 2


def test_a_row_too_many_is_read_and_noted() -> None:
    capture = parse_bvh(SIMPLE + "2 90 0 0 0 0\n")
    assert capture.frames == 3
    assert capture.notes == ("the header states 2 frames, but the file has 3",)


@pytest.mark.parametrize(
    ("old", "new", "line", "words"),
    [
        ("HIERARCHY", "solid cube", 1, "not HIERARCHY"),
        ("OFFSET 0 90 0", "OFFSET 0 90", 4, "2 numbers, expected 3"),
        ("OFFSET 0 90 0", "OFFSET 0 tall 0", 4, "not a number"),
        ("Zrotation", "Wrotation", 5, "channel Wrotation does not exist"),
        ("CHANNELS 6", "CHANNELS 5", 5, "states 5 channels but names 6"),
        ("}\nMOTION", "MOTION", 10, "before the hierarchy is complete"),
        ("Frames: 2", "Frames: two", 12, "expected 'Frames:'"),
        ("0.04", "0", 13, "the frame time is 0.0 s"),
        ("1 90 0 90 0 0", "1 90 0 90 0", 15, "frame 2 has 5 numbers"),
        ("1 90 0 90 0 0", "1 90 nan 90 0 0", 15, "not finite"),
        ("ROOT Hips", "JOINT Hips", 2, "is not allowed here"),
    ],
)
def test_error_names_the_line(old: str, new: str, line: int, words: str) -> None:
    with pytest.raises(InputError, match=words) as caught:
        parse_bvh(SIMPLE.replace(old, new, 1))
    assert f"line {line}" in caught.value.where


def test_truncated_or_empty_file_is_refused() -> None:
    with pytest.raises(InputError, match="ends where"):
        parse_bvh(SIMPLE[: SIMPLE.index("Frame Time")])
    with pytest.raises(InputError, match="no frames"):
        parse_bvh(SIMPLE[: SIMPLE.index("0 90 0 0 0 0")])
    with pytest.raises(InputError, match="the file does not exist"):
        read_bvh("there/is/no.bvh")


@pytest.mark.parametrize("unit", list(UNITS))
def test_the_unit_is_guessed_by_the_legs(unit: str) -> None:
    for leg in (0.72, 0.82, 0.92):
        assert guess_unit(leg / UNITS[unit]) == unit


def same(text: str) -> None:
    """Checks that the text is read in the same way as :data:`SIMPLE`."""
    capture, expected = parse_bvh(text), parse_bvh(SIMPLE)
    assert (capture.names, capture.parents, capture.notes) == (expected.names, expected.parents, ())
    np.testing.assert_allclose(capture.positions, expected.positions, atol=1e-12)
    assert capture.seconds == expected.seconds


LAYOUTS = {
    "brace on the line of the name": lambda text: text.replace("Hips\n{", "Hips {").replace("Site\n  {", "Site {"),  # noqa: E501
    "brace without a blank": lambda text: text.replace("Hips\n{", "Hips{"),
    "all words in one line": lambda text: text[: text.index("MOTION")].replace("\n", " ") + text[text.index("MOTION") :],  # noqa: E501
    "each word on a line": lambda text: text.replace("OFFSET 0 90 0", "OFFSET\n0\n90\n0").replace("ROOT Hips", "ROOT\nHips"),  # noqa: E501
    "upper case": lambda text: text.replace("Frames", "FRAMES").replace("Frame Time", "FRAME TIME").replace("End Site", "END SITE"),  # noqa: E501
    "lower case": lambda text: text.lower().replace("hips", "Hips"),
    "rows over lines": lambda text: text.replace("0 90 0 0 0 0", "0 90 0\n0 0 0").replace("1 90 0 90 0 0", "1 90\n0 90 0 0"),  # noqa: E501
    "two rows in a line": lambda text: text.replace("0 90 0 0 0 0\n1", "0 90 0 0 0 0 1"),
    "comments": lambda text: "# made by hand\n" + text.replace("Hips\n", "Hips # the root\n// below\n").replace("0 90 0 0 0 0\n", "0 90 0 0 0 0 # rest\n"),  # noqa: E501
    "blank lines and tabs": lambda text: text.replace("\n", "\n\n").replace(" ", "\t"),
    "old Macintosh line ends": lambda text: text.replace("\n", "\r"),
    "blanks before colons": lambda text: text.replace("Frames:", "Frames :").replace("Frame Time:", "Frame Time :"),  # noqa: E501
    "no blank after colons": lambda text: text.replace("Frames: ", "Frames:").replace("Time: ", "Time:"),
    "no blank in the label": lambda text: text.replace("Frame Time", "FrameTime"),
}  # fmt: skip


@pytest.mark.parametrize("layout", list(LAYOUTS))
def test_layouts_of_other_programs_are_read(layout: str) -> None:
    same(LAYOUTS[layout](SIMPLE))


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "utf-16-be", "cp1252"])
def test_names_keep_their_letters_in_every_encoding(tmp_path, encoding: str) -> None:
    path = tmp_path / "a.bvh"
    mark = b"\xfe\xff" if encoding == "utf-16-be" else b""
    path.write_bytes(mark + SIMPLE.replace("Hips", "H\u00fcfte").encode(encoding))
    assert read_bvh(path).names == ("H\u00fcfte", "H\u00fcfte end")


def test_names_with_colons_and_signs_are_kept() -> None:
    for name in ("mixamorig:Hips", "Bip01 Pelvis", "Bone#1", "a//b"):
        assert parse_bvh(SIMPLE.replace("Hips", name)).names[0] == name


def test_wrapped_rows_too_many_are_noted() -> None:
    capture = parse_bvh(SIMPLE + "2 90\n0 0 0 0\n")
    assert capture.frames == 3 and capture.notes == ("the header states 2 frames, but the file has 3",)
