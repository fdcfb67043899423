"""Tests of puppets as documents: refused values, storage in a project, and their characters in viewers."""

from __future__ import annotations

import numpy as np
import pytest
from sample_meshes.chair import make_chair

from enliven.document.clip import Clip
from enliven.document.constraints import Coupling, Position, Velocity
from enliven.document.history import History
from enliven.document.locomotion import Switch
from enliven.document.project import Project, are_identical
from enliven.document.puppet import (
    ControlPoint,
    ExampleCharacter,
    KeyPose,
    Plane,
    PuppetLayer,
    character_from_puppet,
)
from enliven.document.skeleton import Skeleton
from enliven.errors import InputError
from enliven.formats.project.file import parse_project, project_bytes
from enliven.wire.convert_characters import character_to_message, message_to_character

POINTS = (ControlPoint("left", 0, "hand"), ControlPoint("right", 9, weight=2.0, foot=True))


def take():
    skeleton = Skeleton(("hips", "hand"), np.array([-1, 0]), np.array([[0, 1, 0], [0, 1.5, 0]]))
    return Clip("wave", skeleton, np.tile([1.0, 0, 0, 0], (5, 2, 1)), np.zeros((5, 3)), 0.1)


def puppet():
    mesh = make_chair()
    rest = mesh.vertices[[0, 9]]
    switches = Switch(0, "contact"), Switch(2, "flight")
    layer = PuppetLayer(
        "wave", ("left",), 0.5, False, True, False, switches,
        (Position("left", 1, (0.0, 1.0, 0.0)),), (Velocity("left", 2, (0.0, 0.0, 0.0), "y"),),
        (Coupling("left", "right", 3),), offset=0.5, speed=-2.0, loop=True,
    )  # fmt: skip
    poses = (KeyPose("wave", 0.1, rest), KeyPose("wave", 0.3, rest + 0.1))
    plane = Plane((0.0, 0.0, 0.0), (1.0, 0.0, 0.0))
    return ExampleCharacter("chair", mesh, POINTS, poses, (layer,), plane, np.array([1.0, 0, 0]))


def project():
    return Project().with_takes(take()).with_characters(puppet())


def test_a_project_file_keeps_a_puppet_bit_for_bit():
    data = project_bytes(project())
    assert are_identical(project(), parse_project(data))
    assert project_bytes(parse_project(data)) == data


def test_history_shares_unchanged_data():
    history = History(project())
    mesh = history.project.puppet("chair").mesh
    changed = project().puppet("chair").with_changes(place=np.array([2.0, 0, 0]))
    history.record_edit("move", history.project.with_characters(changed))
    assert history.project.puppet("chair").mesh is mesh
    assert history.project.puppet("chair").place[0] == 2.0
    assert history.undo().puppet("chair").place[0] == 1.0


def test_the_wire_keeps_its_character():
    character = character_from_puppet(puppet())
    again = message_to_character(character_to_message(character, 3))
    assert again.kind == "points"
    assert again.held is not None and again.held.tolist() == [0, 9]
    assert np.array_equal(again.pivots[1:], puppet().rest.astype(np.float32))
    assert not again.skin.indices.any() and (again.skin.weights[:, 0] == 1).all()


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        (
            {"points": (ControlPoint("a", 0), ControlPoint("a", 1)), "poses": (), "layers": ()},
            "the same name in this list: a, a",
        ),
        ({"points": (ControlPoint("a", 10**6),), "poses": (), "layers": ()}, "vertex 1000000 is not among"),
        ({"poses": (KeyPose("wave", 0.0, np.zeros((3, 3))),)}, "3 positions for 2"),
        ({"poses": (KeyPose("wave", 0.0, np.full((2, 3), np.nan)),)}, "key pose 0 is not a finite number"),
        ({"layers": (PuppetLayer("wave", ("nose",)),)}, "'nose', which does not exist"),
        ({"turn": np.ones(4)}, "not a unit quaternion"),
    ],
)
def test_inconsistent_puppet_is_refused(changes, said):
    with pytest.raises(InputError, match=said):
        puppet().with_changes(**changes)


def test_missing_takes_are_named():
    with pytest.raises(InputError, match="no take 'wave'"):
        Project().with_characters(puppet())


def test_missing_puppet_and_point_are_reported():
    with pytest.raises(InputError, match="no puppet 'horse'"):
        project().puppet("horse")
    with pytest.raises(InputError, match="no control point 'tail'"):
        puppet().index("tail")
