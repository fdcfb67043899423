"""Tests that independent receivers on loopback read every protocol, with left, right, front and back."""

from dataclasses import replace

import numpy as np
import pytest
from live_receivers import Avatar, JsonReceiver, OscReceiver, euler_turn, turn
from live_scenes import CHAIR_PLACE, CHAIR_TURN, chair, four_characters
from made_people import convention_name, person
from patience import wait_until
from posed_people import character, create_pose, performer, some_turns

from enliven.document import Props
from enliven.errors import InputError
from enliven.outputs.humanoid_map import humanoid_map
from enliven.outputs.live_frame import CharacterInfo, LiveEvent, LiveFrame
from enliven.outputs.opening import open_outputs
from enliven.outputs.osc_template import MAX_PACKET_BYTES
from enliven.outputs.settings import LiveOutputSettings
from enliven.person.human_pose import human_of_body
from enliven.person.joints import Joint
from enliven.rotation import rotate, unit

MIRROR = np.array([-1.0, 1.0, 1.0])
"""From enliven's axes to Unity's."""
SEGMENTS = {
    f"{side.title()}{bone}": (Joint[f"{begins}_{side}"], Joint[f"{ends}_{side}"])
    for side in ("LEFT", "RIGHT")
    for bone, begins, ends in (
        ("UpperArm", "SHOULDER", "ELBOW"),
        ("LowerArm", "ELBOW", "WRIST"),
        ("UpperLeg", "HIP", "KNEE"),
        ("LowerLeg", "KNEE", "ANKLE"),
    )
}
"""The joints at the ends of each humanoid bone."""


@pytest.fixture
def sent(tmp_path):
    """Returns a function that sends frames to an OSC receiver and returns the receiver once it has read
    them.
    """
    receivers = []

    def send(scheme: str, *frames, source: str = "", last: str, **keys) -> OscReceiver:
        receiver = OscReceiver()
        receivers.append(receiver)
        settings = LiveOutputSettings(f"{scheme}:127.0.0.1:{receiver.port}{source}", **keys)
        with open_outputs({"test": settings}, tmp_path) as outputs:
            for number, frame in enumerate(frames):
                outputs.put(frame)
                wait_until(lambda n=number: len(receiver.history[last]) > n, f"frame {number}")
        return receiver

    yield send
    for receiver in receivers:
        receiver.__exit__()


def bones_of(receiver: OscReceiver) -> dict[str, tuple[float, ...]]:
    return {key[1]: numbers for key, numbers in receiver.values.items() if key[0] == "/VMC/Ext/Bone/Pos"}


def trackers_of(receiver: OscReceiver) -> dict[str, tuple[float, ...]]:
    return {key[1]: numbers for key, numbers in receiver.values.items() if key[0] == "/VMC/Ext/Tra/Pos"}


# --- VMC -----------------------------------------------------------------------------------------------


def test_vmc_moves_an_avatar_as_the_performer_moves(sent):
    body = performer()
    receiver = sent("vmc", LiveFrame(0, {1: body}), last="/VMC/Ext/OK")
    wait_until(lambda: len(bones_of(receiver)) == 21, "all bones")
    avatar = Avatar(bones_of(receiver))
    for bone, (begins, ends) in SEGMENTS.items():
        along = unit(body.joints[ends] - body.joints[begins])
        assert np.allclose(avatar.direction(bone), MIRROR * along, atol=1e-5), bone
        assert np.allclose(avatar.position(bone), MIRROR * body.joints[begins], atol=1e-5), bone
    # The pose in words, in Unity's axes: the left arm points to the front, and the left knee is up.
    front, left = avatar.rotate_direction("Hips", [0, 0, 1]), avatar.rotate_direction("Hips", [-1, 0, 0])
    assert avatar.direction("LeftUpperArm") @ front > 0.8 and avatar.direction("RightUpperArm") @ left < -0.6
    assert avatar.direction("LeftUpperLeg") @ front > 0.6 > 0.2 > avatar.direction("RightUpperLeg") @ front
    assert avatar.position("LeftUpperArm") @ left > avatar.position("RightUpperArm") @ left
    assert avatar.direction("LeftUpperArm")[0] < 0, "the performer turns to the left, which is -X in Unity"


def test_vmc_sends_status_time_and_root(sent):
    frames = [LiveFrame(7 * 10**9 + k * 500_000_000, {1: performer()}) for k in range(3)]
    receiver = sent("vmc", *frames, LiveFrame(9 * 10**9, {}), last="/VMC/Ext/OK")
    assert receiver.history["/VMC/Ext/OK"] == [(1, 3, 0, 1)] * 3 + [(0, 0, 0, 0)]
    assert [t for (t,) in receiver.history["/VMC/Ext/T"]] == pytest.approx([0.0, 0.5, 1.0, 2.0])
    assert receiver.values["/VMC/Ext/Root/Pos", "root"] == (0, 0, 0, 0, 0, 0, 1)


@pytest.mark.slow
def test_vmc_sends_four_characters_in_small_bundles(sent):
    frame = four_characters()
    receiver = sent("vmc", frame, last=("/VMC/Ext/Tra/Pos", "prop-4"))
    wait_until(lambda: len(trackers_of(receiver)) >= 40, "all trackers")
    assert max(receiver.sizes) <= MAX_PACKET_BYTES < 1500
    trackers = trackers_of(receiver)
    # Anna is the first human on the stage. All other objects are trackers, and so are the bones of their
    # rigs.
    assert {"ben", "horse", "chair", "performer-1", "performer-2", "prop-3", "prop-4"} <= set(trackers)
    assert "anna" not in trackers and "horse/Left fore hoof" in trackers
    assert trackers["prop-3"] == (-1.0, 2.0, 3.0, 0, 0, 0, 1)
    expected = MIRROR * (rotate(CHAIR_TURN, chair()[0].pivots.mean(0)) + CHAIR_PLACE)
    assert np.allclose(trackers["chair"][:3], expected, atol=1e-5)
    for axis in np.eye(3):
        assert np.allclose(
            turn(trackers["chair"][3:], MIRROR * axis), MIRROR * rotate(CHAIR_TURN, axis), atol=1e-5
        )


@pytest.mark.slow
@pytest.mark.parametrize("name", ["anna", "ben"])
def test_vmc_sends_the_character_that_the_address_names(sent, name):
    frame = four_characters()
    receiver = sent("vmc", frame, source=f"/{name}", last="/VMC/Ext/OK")
    wait_until(lambda: len(bones_of(receiver)) >= 20, "the bones")
    avatar, human = Avatar(bones_of(receiver)), frame.find_human_character(name)
    for bone in ("LeftUpperArm", "RightLowerLeg"):
        place, way = human.get_bone(bone)
        assert np.allclose(avatar.position(bone), MIRROR * place, atol=1e-4)
        straight = [1.0, 0, 0] if "Arm" in bone else [0, -1.0, 0]
        assert np.allclose(avatar.direction(bone), MIRROR * rotate(way, straight), atol=1e-4)


@pytest.mark.slow
@pytest.mark.parametrize("convention", ["mixamo", "rigify"])
def test_vmc_moves_an_avatar_as_the_rig_moves(sent, convention):
    skeleton = person(convention, np.random.default_rng(5))
    pose, joints = create_pose("rig", skeleton, some_turns(len(skeleton), 5), (0.3, 0.0, -1.0))
    info = CharacterInfo(character("rig", skeleton), humanoid_map(skeleton))
    receiver = sent("vmc", LiveFrame(0, {}, [pose], {"rig": info}), last="/VMC/Ext/OK")
    wait_until(lambda: len(bones_of(receiver)) >= 20, "the bones")
    avatar = Avatar(bones_of(receiver))
    for side in ("Left", "Right"):
        for bone, begins, ends in (("UpperArm", "shoulder", "elbow"), ("LowerLeg", "knee", "ankle")):
            begin, end = (
                joints[skeleton.index(convention_name(convention, f"{side} {j}"))] for j in (begins, ends)
            )
            assert np.allclose(avatar.direction(f"{side}{bone}"), MIRROR * unit(end - begin), atol=1e-4)


def test_vmc_refuses_bones_of_a_character_that_is_not_human():
    characters = four_characters().characters
    with (
        open_outputs({"--out x": LiveOutputSettings("vmc:127.0.0.1:9/horse")}) as outputs,
        pytest.raises(InputError, match=r"no humanoid bones.*tracker.*--drive skeleton"),
    ):
        outputs.check(characters)
    with open_outputs({"--out x": LiveOutputSettings("vmc:127.0.0.1:9/anna")}) as outputs:
        outputs.check(characters)


# --- VRChat --------------------------------------------------------------------------------------------


@pytest.mark.parametrize("height", [0.0, 1.4])
def test_vrchat_trackers_are_at_the_joints_scaled_to_the_user(sent, height):
    body = performer()
    last = "/tracking/trackers/head/rotation"
    receiver = sent("vrchat", LiveFrame(0, {1: body}), last=last, height=height)
    scale = height / 1.75 if height else 1.0
    joints = {"1": "HIP_CENTER", "3": "ANKLE_LEFT", "4": "ANKLE_RIGHT", "5": "KNEE_LEFT", "8": "ELBOW_RIGHT"}
    for tracker, joint in {**joints, "head": "HEAD"}.items():
        place = receiver.values[f"/tracking/trackers/{tracker}/position"]
        assert np.allclose(place, scale * MIRROR * body.joints[Joint[joint]], atol=1e-5)
    human = human_of_body(body, "")
    for tracker, bone in (("1", "Hips"), ("5", "LeftUpperLeg"), ("7", "LeftUpperArm"), ("head", "Head")):
        degrees = receiver.values[f"/tracking/trackers/{tracker}/rotation"]
        for axis in np.eye(3):
            expected = MIRROR * rotate(human.get_bone(bone)[1], axis)
            assert np.allclose(euler_turn(degrees, MIRROR * axis), expected, atol=1e-4), bone
    # The performer turns 0.6 rad to the left, which is a negative yaw in Unity.
    assert receiver.values["/tracking/trackers/1/rotation"][1] == pytest.approx(-np.degrees(0.6), abs=0.01)
    assert len(receiver.values) == 18 and max(receiver.sizes) <= MAX_PACKET_BYTES


@pytest.mark.slow
def test_vrchat_follows_the_performer_of_the_address(sent):
    people = {1: performer(), 2: performer(2, place=(-1.0, 0.9, -3.0))}
    last = "/tracking/trackers/head/rotation"
    receiver = sent("vrchat", LiveFrame(0, people), source="/performer-2", last=last)
    assert receiver.values["/tracking/trackers/1/position"] == pytest.approx((1.0, 0.9, -3.0))


# --- Rokoko --------------------------------------------------------------------------------------------

ROKOKO_REST = {
    "leftUpperArm": ((-0.5, -0.5, 0.5, -0.5), (-1, 0, 0)),
    "rightLowerArm": ((0.5, -0.5, 0.5, 0.5), (1, 0, 0)),
    "leftUpLeg": ((0.0, 0.7071, 0.0, 0.7071), (0, -1, 0)),
    "rightLeg": ((0.0, -0.7071, 0.0, 0.7071), (0, -1, 0)),
}
"""Rotation of each joint in the T-pose of Rokoko's plug-in for Unity, and the bone's direction there."""
ROKOKO_SEGMENTS = {
    "leftUpperArm": "LeftUpperArm",
    "rightLowerArm": "RightLowerArm",
    "leftUpLeg": "LeftUpperLeg",
    "rightLeg": "RightLowerLeg",
}


@pytest.mark.parametrize("compress", [True, False])
def test_rokoko_moves_an_actor_as_the_performer_moves(compress):
    body = performer()
    with JsonReceiver() as receiver:
        settings = LiveOutputSettings(f"rokoko:127.0.0.1:{receiver.port}", compress=compress)
        with open_outputs({"r": settings}) as outputs:
            outputs.put(LiveFrame(0, {1: body}))
            packet = receiver.read()
    (actor,) = packet["scene"]["actors"]
    assert packet["version"] == "3,0" and actor["name"] == "performer-1" and len(actor["body"]) == 23
    for joint, (rest, straight) in ROKOKO_REST.items():
        begins, ends = SEGMENTS[ROKOKO_SEGMENTS[joint]]
        values = actor["body"][joint]
        at = np.array([values["position"][axis] for axis in "xyz"])
        assert np.allclose(at, MIRROR * body.joints[begins], atol=1e-3)
        # Like the plug-in: undo Rokoko's rest rotation, then apply the avatar's own T-pose.
        own = turn([-rest[0], -rest[1], -rest[2], rest[3]], straight)
        way = turn([values["rotation"][axis] for axis in "xyzw"], own)
        assert np.allclose(way, MIRROR * unit(body.joints[ends] - body.joints[begins]), atol=1e-3), joint


@pytest.mark.slow
def test_rokoko_sends_people_rigs_and_objects():
    frame = four_characters()
    with (
        JsonReceiver() as receiver,
        open_outputs({"r": LiveOutputSettings(f"rokoko:127.0.0.1:{receiver.port}")}) as outputs,
    ):
        outputs.put(frame)
        scene = receiver.read()["scene"]
        outputs.put(four_characters(frame.time_ns + 20_000_000))
        second = receiver.read()
    assert [actor["name"] for actor in scene["actors"]] == ["performer-1", "performer-2", "anna", "ben"]
    assert [each["name"] for each in scene["characters"]] == ["horse"]
    assert {each["name"] for each in scene["props"]} == {"chair", "box-3", "ball-4"}
    assert second["fps"] == 50.0 and second["scene"]["timestamp"] == pytest.approx(0.02)
    for actor in scene["actors"]:
        assert actor["meta"] == {"hasBody": True, "hasFace": False, "hasGloves": False,
                                 "hasLeftGlove": False, "hasRightGlove": False}  # fmt: skip
        assert 1.0 < actor["dimensions"]["totalHeight"] < 2.5


# --- OSC -----------------------------------------------------------------------------------------------


def test_osc_sends_joints_confidence_contacts_and_characters(sent):
    frame = four_characters()
    receiver = sent("osc", frame, last="/enliven/prop/4/position")
    wait_until(lambda: "/enliven/character/chair/held" in receiver.values)
    values, body = receiver.values, frame.performers[2]
    assert values["/enliven/performers"] == (2,) and values["/enliven/time"] == (0.0,)
    for joint in Joint:
        at = values[f"/enliven/performer/2/joint/{joint.name.lower()}"]
        assert np.allclose(at, body.joints[joint], atol=1e-5)
        sure = values[f"/enliven/performer/2/confidence/{joint.name.lower()}"]
        assert sure == pytest.approx((body.confidence[joint],), abs=1e-6)
    assert values["/enliven/performer/1/contact/left"] == pytest.approx((0.1,))
    assert values["/enliven/performer/1/contact/right"] == pytest.approx((0.9,))
    assert values["/enliven/performer/1/height"] == pytest.approx((1.75,))
    assert values["/enliven/character/anna/held"] == (1,) and values["/enliven/character/chair/held"] == (0,)
    assert np.allclose(
        values["/enliven/character/chair/rotation"], [*CHAIR_TURN[1:], CHAIR_TURN[0]], atol=1e-5
    )
    assert values["/enliven/prop/3/position"] == (1.0, 2.0, 3.0)
    assert max(receiver.sizes) <= MAX_PACKET_BYTES


def test_osc_sends_every_event_although_frames_are_skipped(sent):
    events = [LiveEvent("enter", 1), LiveEvent("possess", 1, "chair"), LiveEvent("release", 0, "chair")]
    frame = LiveFrame(0, {}, events=events)
    receiver = sent("osc", frame, last="/enliven/time")
    wait_until(lambda: ("/enliven/event/release", "chair") in receiver.values)
    assert receiver.values["/enliven/event/enter"] == (1,)
    assert receiver.values["/enliven/event/possess", "chair"] == (1,)
    assert receiver.values["/enliven/event/release", "chair"] == (0,)


def test_an_osc_mapping_file_renames_and_drops_addresses(sent, tmp_path):
    (tmp_path / "lights.toml").write_text(
        'others = false\n[addresses]\n"/enliven/performer/1/joint/hand_left" = "/light/spot"\n'
        '"/enliven/performer/*/height" = "/person/*/tall"\n"/enliven/performer/*/confidence/*" = ""\n'
        '"/enliven/event/*" = "/cue/*"\n'
    )
    body = performer()
    frame = LiveFrame(0, {1: body, 2: performer(2)}, events=[LiveEvent("enter", 2)])
    receiver = sent("osc", frame, last="/person/2/tall", map="lights.toml")
    assert set(receiver.values) == {"/light/spot", "/person/1/tall", "/person/2/tall", "/cue/enter"}
    assert np.allclose(receiver.values["/light/spot"], body.joints[Joint.HAND_LEFT], atol=1e-5)


def test_osc_addresses_contain_encoded_names(sent):
    mesh, pose = chair()
    mesh, pose = replace(mesh, id="Jürgen #2/left"), replace(pose, character="Jürgen #2/left")
    frame = LiveFrame(0, {}, [pose], {mesh.id: CharacterInfo(mesh)})
    receiver = sent("osc", frame, last="/enliven/character/J%C3%BCrgen%20%232%2Fleft/held")
    assert receiver.values["/enliven/character/J%C3%BCrgen%20%232%2Fleft/held"] == (0,)


@pytest.mark.parametrize("written", ["Jürgen B.", "J%C3%BCrgen%20B."])
def test_an_osc_mapping_file_contains_names_plain_or_encoded(written, sent, tmp_path):
    text = f'others = false\n[addresses]\n"/enliven/character/{written}/position" = "/spot"\n'
    (tmp_path / "names.toml").write_text(text, encoding="utf-8")
    mesh, pose = chair()
    mesh, pose = replace(mesh, id="Jürgen B."), replace(pose, character="Jürgen B.")
    frame = LiveFrame(0, {}, [pose], {mesh.id: CharacterInfo(mesh)})
    assert set(sent("osc", frame, last="/spot", map="names.toml").values) == {"/spot"}


@pytest.mark.slow
def test_values_that_are_not_finite_are_sent_as_zero(sent):
    body = performer()
    body.joints[Joint.HAND_LEFT] = np.nan, np.inf, -np.inf
    receiver = sent("osc", LiveFrame(0, {1: body}), last="/enliven/performer/1/height")
    assert receiver.values["/enliven/performer/1/joint/hand_left"] == (0.0, 0.0, 0.0)


@pytest.mark.slow
def test_an_empty_stage_is_sent(sent):
    nothing = (
        np.zeros(0, int),
        np.zeros(0, np.uint8),
        np.zeros((0, 3), np.float32),
        np.zeros((0, 3), np.uint8),
    )
    empty = LiveFrame(0, {}, props=Props(0, *nothing, np.zeros((0, 3)), np.zeros((0, 4))))
    for scheme, last in (("vmc", "/VMC/Ext/OK"), ("osc", "/enliven/performers")):
        assert sent(scheme, empty, last=last).values[last][0] == 0
