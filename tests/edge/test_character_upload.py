"""Tests of uploading characters to a running stage: the current character stays until a valid one has
arrived.
"""

import hashlib
import time
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from known_bodies import t_woman
from patience import TIMEOUT_S
from sample_meshes.chair import make_chair

from enliven.deformation.graph.graph import DeformationGraph, character_from_graph
from enliven.deformation.skinning import skin_vertices
from enliven.document.project import Project
from enliven.errors import InputError
from enliven.formats.project.one_character import character_bytes, project_of_mesh
from enliven.meshes import MeshMaterials, Texture
from enliven.possession import ActorSettings, EmbeddedActor, find_person_in_mesh
from enliven.samples.shipped import cactus_project
from enliven.wire import (
    MAX_PART_BYTES,
    MAX_TEXTURE_BYTES,
    MAX_UPLOAD_BYTES,
    Awaited,
    CharacterPart,
    Done,
    PutCharacter,
    character_to_message,
    message_to_character,
)
from enliven_edge import character_upload as module
from enliven_edge.character_upload import CharacterUploads
from enliven_edge.settings import EdgeSettings
from enliven_edge.stage import character_setup
from enliven_edge.stage.stage import Stage

from .matching.rigs_for_stage import star
from .stage.test_stage import FRAME, farthest, person

MESH = make_chair(0.05)
CHAIR = character_bytes(project_of_mesh(MESH, "chair"), "chair")
SETTINGS = EdgeSettings(nodes=32)
COMPILED_WITHIN = 10 * TIMEOUT_S
"""Timeout in seconds for preparing a character, including the compilation of its kernels."""


def order_of(data: bytes, name="chair", revision=1, fit=False) -> PutCharacter:
    return PutCharacter(name, revision, hashlib.sha256(data).digest(), len(data), fit)


def send(uploads: CharacterUploads, data: bytes, order: PutCharacter, step=MAX_PART_BYTES) -> int:
    """Acts as a client until the character is on the stage. Returns the number of parts sent."""
    parts, deadline = 0, time.monotonic() + COMPILED_WITHIN
    while (answer := uploads.announce(order)) != Done():
        assert isinstance(answer, Awaited) and time.monotonic() < deadline
        at = answer.received
        while at < len(data):
            part = CharacterPart(order.id, order.digest, at, data[at : at + step])
            at, parts = uploads.add_part(part).received, parts + 1
        uploads.poll()
        time.sleep(0.001)
    return parts


def possessed(x=0.0) -> Stage:
    graph = DeformationGraph.build(MESH, nodes=32, seed=0)
    stage = Stage([EmbeddedActor(character_from_graph(MESH, graph, "chair"), graph, ActorSettings(fade=0.1))])
    stage.perform([person(x=x)], 0)
    stage.possess("chair")
    return stage


@pytest.mark.parametrize(
    ("project", "name", "kind"),
    [
        (project_of_mesh(MESH, "chair"), "chair", "graph"),
        (Project().with_characters(star()), "star", "bones"),
        (cactus_project(), "cactus", "points"),
    ],
    ids=("possessed", "rigged", "puppet"),
)
def test_a_character_of_any_rig_is_put_and_performs_and_equal_data_is_sent_once(project, name, kind):
    stage = Stage()
    uploads, data = CharacterUploads(stage, SETTINGS), character_bytes(project, name)
    assert send(uploads, data, order_of(data, "guest"), 1000) == -(-len(data) // 1000)
    assert stage.characters["guest"].kind == kind and uploads.revisions == {"guest": 1}
    assert [pose.character for pose in stage.perform([person()], FRAME)] == ["guest"]
    assert send(uploads, data, order_of(data, "guest", 2)) == 0
    stage.remove("guest")
    uploads.poll()
    assert uploads.revisions == {} and send(uploads, data, order_of(data, "guest", 3)) > 0


@pytest.mark.slow
def test_a_character_that_is_put_brings_its_textures_as_far_as_the_wire_carries_them_back():
    """Its images reach the stage byte for byte. Images larger than a message are not sent."""
    picture = np.frombuffer(b"\x89PNG\r\n\x1a\n" + bytes(range(200)), np.uint8)
    uvs = np.random.default_rng(3).random((len(MESH.faces), 3, 1, 2)).astype(np.float32)
    definition = '{"pbrMetallicRoughness":{"baseColorTexture":{"index":0}}}'
    own = MeshMaterials((definition,), (Texture(picture),), np.zeros(len(MESH.faces), np.int32), uvs)
    project = project_of_mesh(replace(MESH, materials=own), "chair")
    for most, is_kept in (
        (MAX_TEXTURE_BYTES, True),
        (len(picture), True),
        (len(picture) - 1, False),
        (0, False),
    ):
        stage = Stage()
        data = character_bytes(project, "chair", most)
        send(CharacterUploads(stage, SETTINGS), data, order_of(data))
        materials = stage.actors["chair"].character.materials
        assert (materials is not None) == is_kept
        if materials is not None:
            assert materials.textures[0].image.tobytes() == picture.tobytes() and materials.definitions == (
                definition,
            )
            np.testing.assert_array_equal(materials.uvs, uvs)
            back = message_to_character(character_to_message(stage.actors["chair"].character, 1)).materials
            assert back is not None and back.textures[0].image.tobytes() == picture.tobytes()


def test_attachment_continues_in_next_revision():
    """The chair is edited while its performer stands elsewhere with a lifted knee. Nothing jumps, and the
    knee stays up.
    """
    stage = possessed()
    uploads, old = CharacterUploads(stage, SETTINGS), stage.actors["chair"].character
    for i in range(1, 25):
        before = stage.perform([person(x=0.02 * i, lift=0.03 * i)], i * FRAME)[0]
    taller = replace(MESH, vertices=MESH.vertices * [1.0, 1.02, 1.0])
    data = character_bytes(project_of_mesh(taller, "chair"), "chair")
    send(uploads, data, order_of(data))
    assert (
        stage.holders == {1}
        and stage.actors["chair"].character.vertices[:, 1].max() > 1.01 * MESH.vertices[:, 1].max()
    )
    after = [stage.perform([person(x=0.48, lift=0.72)], i * FRAME)[0] for i in range(25, 60)]
    moved = skin_vertices(stage.actors["chair"].character, after[0]) - skin_vertices(old, before)
    assert np.linalg.norm(moved, axis=1).max() < 0.2, "its legs are where they were"
    assert farthest(after[0], after[-1]) < 0.03, "it has arrived with its first frame"
    stage.release("chair")
    send(uploads, CHAIR, order_of(CHAIR, revision=2))
    assert not stage.holders


@pytest.mark.slow
@settings(max_examples=12)
@given(st.data())
def test_no_message_sequence_harms_the_stage(data):
    stage = possessed()
    uploads, stood = CharacterUploads(stage, SETTINGS), stage.actors["chair"]
    names, digests = (
        st.sampled_from(["chair", "b", "c", "d", "e", "f"]),
        st.sampled_from([bytes(32), b"\1" * 32]),
    )
    sizes = st.sampled_from([1, 5, MAX_UPLOAD_BYTES // 2, MAX_UPLOAD_BYTES])
    puts = st.builds(PutCharacter, names, st.integers(1, 3), digests, sizes, st.booleans())
    parts = st.builds(CharacterPart, names, digests, st.integers(0, 6), st.binary(max_size=6))
    for message in data.draw(st.lists(puts | parts, max_size=25)):
        try:
            (uploads.announce if isinstance(message, PutCharacter) else uploads.add_part)(message)
        except InputError as error:
            assert error.remedy
        assert sum(each.order.size for each in uploads._waiting.values()) <= MAX_UPLOAD_BYTES
        assert len(uploads._waiting) <= 4
    deadline = time.monotonic() + TIMEOUT_S
    while uploads._complete or uploads._preparing:
        uploads.poll()
        assert time.monotonic() < deadline
    assert list(stage.actors) == ["chair"] and stage.actors["chair"] is stood and stage.holders == {1}


@settings(max_examples=15)
@given(st.integers(0, len(CHAIR) - 1), st.integers(1, 255), st.booleans())
def test_data_that_is_cut_or_changed_is_refused_in_a_sentence(at, by, cut):
    data = CHAIR[:at] + (b"" if cut else bytes([CHAIR[at] ^ by]) + CHAIR[at + 1 :])
    stage = Stage()
    uploads = CharacterUploads(stage, SETTINGS)
    try:
        send(uploads, data or b"x", order_of(data or b"x"))
    except InputError as error:
        assert error.what and not stage.actors
        with pytest.raises(InputError):
            uploads.announce(order_of(data or b"x"))
    else:
        vertices = stage.characters["chair"].vertices
        np.testing.assert_allclose(vertices, MESH.vertices, atol=1e-6)  # a byte that no reader uses


def wild_star():
    character = star()
    return character.with_changes(
        mesh=replace(character.mesh, vertices=character.mesh.vertices * [1, 1, np.nan])
    )


def unpaired_cactus() -> Project:
    """Returns a cactus with key poses, and a control point that is not paired with a joint."""
    project = cactus_project()
    puppet = project.puppet("cactus")
    first, *others = puppet.points
    points = (replace(first, joint=""), *others)
    return project.with_characters(puppet.with_changes(points=points))


@pytest.mark.parametrize(
    ("project", "name", "why"),
    [
        (
            project_of_mesh(replace(MESH, vertices=MESH.vertices * 1e5), "chair"),
            "chair",
            "Scale the mesh to metres",
        ),
        (Project().with_characters(wild_star()), "star", "finite"),
        (project_of_mesh(replace(MESH, faces=MESH.faces[:0]), "chair"), "chair", "no mesh"),
        (project_of_mesh(replace(MESH, vertices=MESH.vertices * 0), "chair"), "chair", "area"),
        (Project().with_characters(star().with_changes(mesh=None, skin=None)), "star", "no mesh"),
        (
            unpaired_cactus(),
            "cactus",
            "move yet",
        ),
    ],
)
def test_a_character_that_cannot_be_moved_is_refused_with_the_reason(project, name, why):
    data = character_bytes(project, name)
    with pytest.raises(InputError, match=why):
        send(CharacterUploads(Stage(), SETTINGS), data, order_of(data, name))


def test_two_characters_and_more_nodes_than_a_frame_moves_are_refused(monkeypatch):
    from enliven.formats.project.file import project_bytes

    two = project_of_mesh(MESH, "a").with_characters(star())
    data = project_bytes(two)
    with pytest.raises(InputError, match="2 characters were sent as one"):
        send(CharacterUploads(Stage(), SETTINGS), data, order_of(data))
    data = project_bytes(Project())
    with pytest.raises(InputError, match="0 characters"):
        send(CharacterUploads(Stage(), SETTINGS), data, order_of(data))
    monkeypatch.setattr("enliven_edge.uploaded_actor._MAX_NODES", 31)
    with pytest.raises(InputError, match="32 nodes"):
        send(CharacterUploads(Stage(), SETTINGS), CHAIR, order_of(CHAIR))


def test_an_older_revision_is_refused_and_one_that_stops_coming_makes_room(monkeypatch):
    stage = Stage()
    uploads = CharacterUploads(stage, SETTINGS)
    send(uploads, CHAIR, order_of(CHAIR, revision=4))
    other = CHAIR + b"x"
    with pytest.raises(InputError, match="Send revision 5"):
        uploads.announce(order_of(other, revision=4))
    assert uploads.announce(order_of(other, revision=5)) == Awaited(0)
    assert uploads.announce(order_of(CHAIR + b"y", revision=6)) == Awaited(0), "a later one takes its place"
    with pytest.raises(InputError, match="not expected"):
        uploads.add_part(CharacterPart("chair", order_of(other).digest, 0, b"x"))
    with pytest.raises(InputError, match="more than the"):
        late = order_of(CHAIR + b"y")
        uploads.add_part(CharacterPart("chair", late.digest, 0, bytes(late.size + 1)))
    for name in "abcd":
        assert uploads.announce(order_of(CHAIR, name)) == Awaited(0)
    with pytest.raises(InputError, match="too many"):
        uploads.announce(order_of(CHAIR, "e"))
    monkeypatch.setattr(module, "_TIMEOUT_S", -1.0)
    assert uploads.announce(order_of(CHAIR, "e")) == Awaited(0)


@pytest.mark.slow
def test_person_search_is_not_repeated_after_moving_vertices(monkeypatch):
    """The search takes as long as all other steps. It is repeated only if faces change, or if it found a
    person.
    """
    searched = list[str]()

    def counting(mesh, *known):
        searched.append(mesh.name)
        return find_person_in_mesh(mesh, *known)

    monkeypatch.setattr(character_setup, "find_person_in_mesh", counting)
    stage = Stage()
    uploads, woman = CharacterUploads(stage, SETTINGS), t_woman().mesh
    coarser = make_chair(0.06)
    sent = (MESH, replace(MESH, vertices=1.1 * MESH.vertices), coarser)
    for revision, (mesh, count) in enumerate(zip(sent, (1, 1, 2), strict=True), 1):
        data = character_bytes(project_of_mesh(mesh, "chair"), "chair")
        send(uploads, data, order_of(data, revision=revision))
        assert len(searched) == count and stage.actors["chair"].likeness is None
    for revision in (1, 2):
        mesh = replace(woman, vertices=(1.0 + 0.02 * revision) * woman.vertices)
        data = character_bytes(project_of_mesh(mesh, "woman"), "woman")
        send(uploads, data, order_of(data, "woman", revision))
        assert len(searched) == 2 + revision and stage.actors["woman"].likeness.human
