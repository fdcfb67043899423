"""Tests of project files: content survives bit for bit, old versions stay readable, and other files give
clear errors.
"""

from __future__ import annotations

import io
import json
import os
import sys
import zipfile
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from enliven.document import graph_shape_from_poses
from enliven.document.character import Character, Pose, SkinWeights
from enliven.document.layers import Span
from enliven.document.project import Project, are_identical
from enliven.errors import InputError, LaterVersionError, ResourceError
from enliven.examples.puppet_motion import convert_to_world_frame, evaluate_state
from enliven.formats.project.file import (
    VERSION,
    parse_project,
    project_bytes,
    read_project,
    write_project,
)
from enliven.formats.project.values import array_checksum, pack, unpack
from enliven.meshes.mesh import Mesh
from enliven.modeling.edits import compute_vertices

sys.path.insert(0, str(Path(__file__).parents[1] / "modeling"))
from surgery_worlds import random_project

STORED = Path(__file__).parent / "projects"


def possessed():
    """Returns a possessed triangle: a character of two nodes, and their motion."""
    skin = SkinWeights(
        np.array([[0, 1, 0, 0]] * 3, np.uint16), np.array([[0.75, 0.25, 0, 0]] * 3, np.float32)
    )
    pivots = np.array([[0, 0, 0], [1, 0, 0]], np.float32)
    character = Character(
        "chair", np.eye(3, dtype=np.float32), np.array([[0, 1, 2]], np.int32), skin, pivots,
        np.array([[0, 1]], np.int32), "graph", np.array([[1, 2, 3]] * 3, np.uint8),
    )  # fmt: skip
    turns = np.tile(np.eye(3, dtype=np.float32), (2, 1, 1))
    poses = [Pose("chair", 40_000_000 * k, turns, pivots + np.float32(0.1 * k)) for k in range(3)]
    return graph_shape_from_poses(character, poses, "dance")


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 10_000))
def test_a_project_comes_back_bit_for_bit(seed):
    project, random = random_project(seed)
    shape = project.shapes["shape 0"]
    count = 12
    mesh = Mesh(random.normal(size=(count, 3)), random.integers(0, count, (5, 3)).astype(np.int32), "blob")
    indices = random.integers(0, len(shape.skeleton), (count, 4)).astype(np.uint16)
    skin = SkinWeights(indices, random.random((count, 4)).astype(np.float32))
    project = project.with_characters(
        shape.with_changes(mesh=mesh, skin=skin, travel_scale=0.1 + random.random())
    )
    graph, stream = possessed()
    project = project.with_streams(stream).with_characters(graph)
    data = project_bytes(project)
    again = parse_project(data)
    assert are_identical(project, again)
    assert project_bytes(again) == data


def test_empty_project_is_restored(tmp_path):
    write_project(tmp_path / "new" / "a.enliven", Project())
    assert are_identical(read_project(tmp_path / "new" / "a.enliven"), Project())


def test_the_first_file_that_ever_was_is_read():
    """The file was stored when version 1 was the newest, and is never regenerated."""
    project = read_project(STORED / "version_1.enliven")
    expected = json.loads((STORED / "version_1.json").read_text())
    assert list(project.shapes) == expected["shapes"]
    shape = project.shapes[expected["shapes"][0]]
    assert shape.skeleton.positions.tolist() == expected["positions"]
    assert [span.before for span in shape.spans[-1]] == [tuple(b) for b in expected["before"]]
    assert shape.layer("wave layer").offset == expected["offset"]
    assert project.takes["wave"].turns[1].tolist() == expected["turns"]
    assert shape.mesh.colours.tolist() == expected["colours"]


TRAVEL_CHANGED = 0.1
"""Metres by which a stored puppet's position differs, since example-driven characters follow their
performer's path.
"""


@pytest.mark.parametrize("file", ["1_rigged", "1_possessed", "1_puppet", "2"])
def test_stored_characters_of_every_kind_move_as_they_did(file):
    """Each file was stored when its version was the newest, with all vertex positions at three times.

    For a puppet, the positions of its control points are stored, which the solver reproduces within 2e-6 m.
    Their positions relative to the puppet have not changed. Since November 2026, the puppet itself follows
    its performer's path.
    """
    project = read_project(STORED / f"version_{file}.enliven")
    expected = json.loads((STORED / "version_1_kinds.json").read_text())
    kinds = expected if file == "2" else {file[2:]: expected[file[2:]]}
    assert list(project.characters) == [name for kind in kinds.values() for name in kind]
    for kind, characters in kinds.items():
        for name, at in characters.items():
            for time, places in at.items():
                if kind != "puppet":
                    np.testing.assert_allclose(
                        compute_vertices(project, name, float(time)), places, atol=2e-6
                    )
                    continue
                seen, stored = control_points_of(project, name, float(time)), np.array(places)
                np.testing.assert_allclose(seen - seen[0], stored - stored[0], atol=2e-6)
                assert np.abs(seen[0] - stored[0]).max() < TRAVEL_CHANGED
    assert are_identical(parse_project(project_bytes(project)), project)


def control_points_of(project, name, time):
    state = evaluate_state(project, project.puppets[name], time)
    return convert_to_world_frame(project.puppets[name], state, state.places)


def test_there_is_a_stored_file_of_this_version():
    assert (STORED / f"version_{VERSION}.enliven").is_file()


def test_a_field_that_an_old_file_lacks_gets_its_default():
    project, _ = random_project(3)
    header, arrays = opened(project_bytes(project))
    for shape in header["project"]["characters"].values():
        for layer in shape["layers"]:
            del layer["mirrored"]
        for spans in shape["spans"]:
            for span in spans:
                del span["before"]
    again = parse_project(closed(header, arrays))
    assert not any(layer.mirrored for shape in again.shapes.values() for layer in shape.layers)
    assert again.shapes["shape 0"].spans[0][0].before == Span().before


def opened(data):
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        header = json.loads(archive.read("project.json"))
        return header, {n: archive.read(n) for n in archive.namelist() if n.startswith("arrays/")}


def closed(header, arrays):
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w") as archive:
        archive.writestr("project.json", json.dumps(header))
        for name, data in arrays.items():
            archive.writestr(name, data)
    return out.getvalue()


LATER = "reads files up to version 2. Update enliven"


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda h: h.update(version=3, made_by="9.9"), f"format version 3, written by enliven 9.9.*{LATER}"),
        (lambda h: (h.update(version=3), h.pop("made_by")), f"format version 3. This.*{LATER}"),
        (lambda h: h.update(version=3, project=["in", "another", "way"]), f"format version 3.*{LATER}"),
        (
            lambda h: (h.update(made_by="9.9"), first_layer(h).update(glow=1)),
            "enliven 9.9, .*update enliven",
        ),
        (lambda h: first_layer(h).update(glow=1), "'glow' is unknown. Use an earlier copy"),
    ],
)
def test_a_project_of_a_later_version_is_refused_and_kept(tmp_path, change, words):
    path = tmp_path / "later.enliven"
    path.write_bytes(spoiled(lambda header, _: change(header)))
    before = path.read_bytes()
    with pytest.raises(InputError, match=words):
        read_project(path)
    assert path.read_bytes() == before


@pytest.mark.parametrize("more", [{}, {"project": "another way"}])
def test_a_project_of_a_later_version_is_not_replaced(tmp_path, more):
    path = tmp_path / "later.enliven"
    path.write_bytes(spoiled(lambda header, _: header.update(version=3, made_by="9.9", **more)))
    before = path.read_bytes()
    with pytest.raises(LaterVersionError, match="format version 3, written by enliven 9"):
        write_project(path, Project())
    assert path.read_bytes() == before and [file.name for file in tmp_path.iterdir()] == ["later.enliven"]


@pytest.mark.parametrize("content", [b"", b"PK", b"a mesh", closed({"format": "enliven project"}, {})])
def test_other_files_are_replaced_as_the_caller_decided(tmp_path, content):
    path = tmp_path / "other.enliven"
    path.write_bytes(content)
    write_project(path, Project())
    assert are_identical(read_project(path), Project())


def first_shape(header):
    return header["project"]["characters"]["shape 0"]


def first_layer(header):
    return first_shape(header)["layers"][0]


def spoiled(change):
    header, arrays = opened(project_bytes(random_project(1)[0]))
    change(header, arrays)
    return closed(header, arrays)


@pytest.mark.parametrize(
    ("change", "words", "where"),
    [
        (lambda h, a: h.update(format="zip"), "not an enliven project", ""),
        (lambda h, a: h.update(version=VERSION + 1, made_by="9.9"), "written by enliven 9.9", ""),
        (lambda h, a: h.update(version="new"), "the header of the project file is damaged", ""),
        (lambda h, a: a.popitem(), "an array is missing", "project."),
        (lambda h, a: a.update({next(iter(a)): b"\x93NUMPY"}), "array in the project is damaged", ""),
        (
            lambda h, a: a.update({k: next(iter(a.values())) for k in a}),
            "array in the project is damaged",
            "",
        ),
        (lambda h, a: first_layer(h).update(glow=1), "'glow' is unknown", "layers[0]"),
        (lambda h, a: first_layer(h).pop("take"), "'take' is missing", "layers[0]"),
        (lambda h, a: first_layer(h).update(speed="fast"), "'fast' is not a float", "speed"),
        (lambda h, a: first_layer(h).update(loop=1), "is not a bool", "loop"),
        (
            lambda h, a: first_shape(h).update(kind="lattice"),
            "kind of character 'lattice' is unknown",
            "shape 0",
        ),
        (lambda h, a: first_shape(h).pop("kind"), "kind of character None is unknown", "shape 0"),
        (lambda h, a: h["project"]["takes"].pop("walk"), "no take 'walk'", "shape"),
    ],
)
def test_damaged_file_is_reported(change, words, where):
    with pytest.raises(InputError, match=words) as caught:
        parse_project(spoiled(change), "my.enliven")
    assert caught.value.where.startswith("my.enliven") and where in caught.value.where


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 3), st.floats(0, 1, exclude_max=True))
def test_a_file_that_is_cut_short_anywhere_is_refused(seed, share):
    data = project_bytes(random_project(seed)[0])
    with pytest.raises(InputError, match=r"truncated or damaged|not an enliven project"):
        parse_project(data[: int(share * len(data))])


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 10_000))
def test_a_bit_that_is_turned_over_is_noticed_or_does_not_matter(seed):
    random = np.random.default_rng(seed)
    project = random_project(5)[0]
    data = bytearray(project_bytes(project))
    data[int(random.integers(len(data)))] ^= 1 << int(random.integers(8))
    try:
        again = parse_project(bytes(data))
    except InputError:
        return
    assert are_identical(project, again)


def test_other_files_are_refused(tmp_path):
    with pytest.raises(InputError, match="the file does not exist"):
        read_project(tmp_path / "none.enliven")
    (tmp_path / "text.enliven").write_text("hello")
    with pytest.raises(InputError, match="not an enliven project"):
        read_project(tmp_path / "text.enliven")
    with zipfile.ZipFile(tmp_path / "other.enliven", "w") as archive:
        archive.writestr("readme.txt", "x")
    with pytest.raises(InputError, match="not an enliven project"):
        read_project(tmp_path / "other.enliven")


def full(*_):
    raise OSError(28, "No space left on device")


def test_the_file_from_before_stays_where_a_new_one_cannot_be_written(tmp_path, monkeypatch):
    project, _ = random_project(2)
    path = tmp_path / "a.enliven"
    write_project(path, project)
    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(ResourceError, match="cannot be written"):
        write_project(path, Project())
    assert are_identical(read_project(path), project)


@settings(max_examples=60, deadline=None)
@given(st.floats(allow_nan=False), st.integers(-(2**60), 2**60), st.text(), st.booleans())
def test_plain_values_come_back_as_they_are(number, whole, text, flag):
    for hint, value in ((float, number), (int, whole), (str, text), (bool, flag)):
        again = unpack(hint, json.loads(json.dumps(pack(value, {}))), {}, "here")
        assert are_identical(value, again)


def test_equal_arrays_are_kept_once_and_others_apart():
    a = np.arange(6.0)
    assert array_checksum(a) == array_checksum(a.copy())
    different = [a + 1, a.astype(np.float32), a.reshape(2, 3), -a, np.array([0.0, -0.0])]
    assert len({array_checksum(x) for x in (a, *different, np.array([0.0, 0.0]))}) == 7
    kept: dict[str, np.ndarray] = {}
    pack((a, a.copy(), a + 1), kept)
    assert len(kept) == 2
