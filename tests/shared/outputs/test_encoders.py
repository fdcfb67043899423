"""Tests that the fast encoders of live outputs send the values of their slow references, for random
stages.
"""

import json
import re
from dataclasses import replace
from urllib.parse import unquote

import lz4.frame
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from live_scenes import chair, four_characters, random_body, random_frame
from plain_outputs import plain_human, plain_rokoko, plain_rows, plain_vmc, unity_numbers
from pythonosc.osc_packet import OscPacket

from enliven.outputs.json_template import MARK, MAX_NUMBER, JsonTemplate
from enliven.outputs.live_frame import CharacterInfo, LiveFrame
from enliven.outputs.osc_tree import OscOutput
from enliven.outputs.rokoko import RokokoOutput
from enliven.outputs.row_kernels import write_bone_rows
from enliven.outputs.vmc import VmcOutput
from enliven.outputs.vrchat import TRACKERS, VrchatOutput
from enliven.person import Joint, human_of_body, unity_euler, unity_position
from enliven.rotation import IDENTITY, canonical, from_matrix, normalized, to_matrix

SEEDS = st.integers(0, 2**32 - 1)


def messages(packets) -> dict:
    """Returns the arguments of each message by its address, or by address and first name."""
    values = {}
    for packet in packets:
        for timed in OscPacket(packet).messages:
            address, (first, *others) = timed.message.address, timed.message.params
            key = (address, first) if isinstance(first, str) else address
            assert key not in values
            values[key] = others if isinstance(first, str) else [first, *others]
    return values


@given(SEEDS)
def test_a_body_has_the_bones_of_its_twin(seed):
    body = random_body(np.random.default_rng(seed), 1)
    fast, slow = human_of_body(body, ""), plain_human(body)
    assert fast.bones == slow.bones
    assert np.allclose(fast.positions, slow.positions, atol=1e-9)
    assert np.allclose(canonical(fast.turns), canonical(slow.turns), atol=1e-7)


@given(SEEDS, st.sampled_from(["rotations", "stretched", "mirrored", "flat", "nothing", "not finite"]))
def test_rotations_of_transforms_are_the_nearest_ones(seed, kind):
    random = np.random.default_rng(seed)
    linear = to_matrix(normalized(random.normal(size=(30, 4))))
    if kind == "stretched":
        linear = linear + random.normal(0.0, 0.2, linear.shape)
    linear *= {"mirrored": -1.0, "flat": np.array([1.0, 1.0, 0.0]), "nothing": 0.0}.get(kind, 1.0)
    linear = linear.astype(np.float32)
    if kind == "not finite":
        linear[:, 1, 2] = random.choice([np.nan, np.inf, -np.inf], 30)
    positions, rows = random.normal(size=(30, 3)).astype(np.float32), np.empty((30, 7))
    write_bone_rows(linear, positions, rows)
    assert np.array_equal(rows[:, :3], positions)
    # Several rotations may be equally near, such as those to a mirrored rotation. All have the same trace.
    if kind == "not finite":
        assert np.array_equal(rows[:, 3:], np.tile(IDENTITY, (30, 1)))
    else:
        for turns in (rows[:, 3:], from_matrix(linear)):
            assert np.allclose(np.linalg.norm(turns, axis=1), 1.0, atol=1e-12)
        near, nearest = (
            np.einsum("nij,nij->n", to_matrix(turns), linear) for turns in (rows[:, 3:], from_matrix(linear))
        )
        assert np.allclose(near, nearest, atol=3e-6)
    assert np.all(rows[:, 3] >= 0.0)


@pytest.mark.slow
@given(SEEDS)
def test_everything_on_the_stage_has_the_row_of_its_twin(seed):
    frame = random_frame(seed)
    expected, rows = plain_rows(frame), frame.rows
    assert rows.labels() == list(expected)
    for row, (position, turn) in zip(rows.values, expected.values(), strict=True):
        assert np.allclose(row[:3], position, atol=1e-5)
        assert abs(row[3:] @ turn) > 1.0 - 1e-9


def same_placement(numbers, expected, precision: float) -> bool:
    """Returns True if seven numbers are the same position and rotation. q and -q are the same rotation."""
    turn, other = np.array(numbers[3:]), np.array(expected[3:])
    nearer = other if turn @ other > 0 else -other
    return bool(np.allclose([*numbers[:3], *turn], [*expected[:3], *nearer], atol=precision))


@pytest.mark.slow
@given(SEEDS, st.sampled_from(["", "anna", "ben", "performer-3"]))
def test_vmc_sends_the_numbers_of_its_twin(seed, source):
    frame = random_frame(seed)
    values, expected = messages(VmcOutput(source).encode_packets(frame)), plain_vmc(frame, source)
    for kind, address in (("bones", "/VMC/Ext/Bone/Pos"), ("trackers", "/VMC/Ext/Tra/Pos")):
        sent = {key[1]: numbers for key, numbers in values.items() if key[0] == address}
        assert sent.keys() == expected[kind].keys()
        assert all(same_placement(sent[name], row, 1e-4) for name, row in expected[kind].items())
    there = frame.find_human(source) is not None
    assert values["/VMC/Ext/OK"] == [there, 3 * there, 0, there]


@pytest.mark.slow
@given(SEEDS)
def test_one_vmc_output_sends_changing_stages(seed):
    output = VmcOutput()
    for number in range(4):
        frame = random_frame(seed + number)
        expected = plain_vmc(frame)
        names = {key[1] for key in messages(output.encode_packets(frame)) if key[0] == "/VMC/Ext/Tra/Pos"}
        assert names == set(expected["trackers"])


@pytest.mark.slow
@given(SEEDS)
def test_vrchat_sends_the_numbers_of_its_twin(seed):
    frame = random_frame(seed)
    packets = VrchatOutput().encode_packets(frame)
    assert bool(packets) == bool(frame.performers)
    if packets:
        number = min(frame.performers)
        body, human, values = frame.performers[number], frame.find_human_performer(number), messages(packets)
        for name, bone, joint in TRACKERS:
            place, angles = (values[f"/tracking/trackers/{name}/{kind}"] for kind in ("position", "rotation"))
            assert np.allclose(place, unity_position(body.joints[joint]), atol=1e-5)
            expected = unity_euler(human.get_bone(bone)[1])
            assert np.allclose((np.array(angles) - expected + 180.0) % 360.0, 180.0, atol=0.01)


@pytest.mark.slow
@given(SEEDS)
def test_osc_sends_the_numbers_of_its_twin(seed):
    frame = random_frame(seed)
    values, rows = messages(OscOutput().encode_packets(frame)), plain_rows(frame)
    expected = {"/enliven/time": [0.0], "/enliven/performers": [len(frame.performers)]}
    for number, body in frame.performers.items():
        path = f"/enliven/performer/{number}"
        for joint in Joint:
            expected[f"{path}/joint/{joint.name.lower()}"] = body.joints[joint]
            expected[f"{path}/confidence/{joint.name.lower()}"] = [body.confidence[joint]]
        left, right = (0.0, 0.0) if body.contacts is None else body.contacts
        expected |= {f"{path}/contact/left": [left], f"{path}/contact/right": [right]}
        expected[f"{path}/height"] = [body.height]
    for pose in frame.poses:
        path, (place, turn) = f"/enliven/character/{pose.character}", rows[pose.character]
        expected[f"{path}/position"], expected[f"{path}/rotation"] = place, [*turn[1:], turn[0]]
        expected[f"{path}/held"] = [pose.character in frame.held]
    if frame.props is not None:
        for number, place in zip(frame.props.ids, frame.props.positions, strict=True):
            expected[f"/enliven/prop/{number}/position"] = place
    assert values.keys() == expected.keys()
    for address, numbers in expected.items():
        sent, numbers = np.array(values[address], float), np.array(numbers, float)
        if address.endswith("/rotation"):
            sent *= np.sign(sent @ numbers)
        assert np.allclose(sent, numbers, atol=1e-4), address


@given(st.lists(st.text(st.characters(exclude_categories=())), min_size=1, max_size=5, unique=True))
def test_osc_addresses_follow_the_specification_and_name_one_character_each(names):
    mesh, pose = chair()
    characters = {name: CharacterInfo(replace(mesh, id=name)) for name in names}
    frame = LiveFrame(0, {}, [replace(pose, character=name) for name in names], characters)
    sent = [
        timed.message.address for p in OscOutput().encode_packets(frame) for timed in OscPacket(p).messages
    ]
    middles = [address.removesuffix("/held") for address in sent if address.endswith("/held")]
    assert len(set(middles)) == len(names)
    assert len(set(sent)) == len(sent) == 2 + 3 * len(names)
    for address in sent:
        assert re.fullmatch(r"(/[^\s#*,/?\[\]{}]+)+", address) and address.isascii() and address.isprintable()
    decoded = [unquote(address.split("/")[3], errors="surrogatepass") for address in middles]
    assert decoded == ["%" if name == "" else name for name in names]


def parts(value, path=""):
    """Yields the path and the value of every leaf of nested objects."""
    if isinstance(value, dict):
        for name, part in value.items():
            yield from parts(part, f"{path}/{name}")
    elif isinstance(value, list) and not path.endswith("color"):
        for number, part in enumerate(value):
            yield from parts(part, f"{path}/{number}")
    else:
        yield path, value


@pytest.mark.slow
@given(SEEDS)
def test_rokoko_sends_the_numbers_of_its_twin(seed):
    output = RokokoOutput()
    for number in range(2):
        frame = random_frame(seed + number)
        (packet,) = output.encode_packets(frame)
        scene = json.loads(lz4.frame.decompress(packet))["scene"]
        sent, expected = dict(parts(scene)), dict(parts(plain_rokoko(frame)))
        constant = {path for path in sent if path.endswith(("color", "type", "timestamp")) or "/meta" in path}
        assert sent.keys() - constant == expected.keys()
        for path, value in expected.items():
            if isinstance(value, str):
                assert sent[path] == value
            elif "/rotation/" not in path:
                assert sent[path] == pytest.approx(value, abs=1e-4), path
            elif path.endswith("/x"):
                at = path.removesuffix("x")
                turn, other = ([each[at + axis] for axis in "xyzw"] for each in (sent, expected))
                assert same_placement([0, 0, 0, *turn], [0, 0, 0, *other], 2e-5), path


NUMBERS = st.one_of(
    st.floats(-10, 10),
    st.floats(allow_nan=True, allow_infinity=True),
    st.integers(-(10**6), 10**6).map(lambda number: number / 1000),
    st.sampled_from([0.0, -0.0, 0.99999999, 9.5, -1e-9, 1e9, 2e9, 0.5, 1e-5, 123456789.123456]),
)


@given(st.lists(st.tuples(NUMBERS, st.integers(1, 8)), min_size=1, max_size=30))
def test_numbers_of_json_are_rounded_and_short(rows):
    numbers, decimals = (np.array(column) for column in zip(*rows, strict=True))
    value = {"ü": [MARK] * len(rows), "text": 'a "quoted" name'}
    text = JsonTemplate(value, decimals).fill_numbers(numbers).decode()
    read = json.loads(text)
    assert read.keys() == value.keys() and read["text"] == value["text"]
    texts = re.search(r"\[(.*?)\]", text)[1].split(",")
    for number, places, sent, digits in zip(numbers, decimals, read["ü"], texts, strict=True):
        wanted = float(np.clip(number if np.isfinite(number) else 0.0, -MAX_NUMBER, MAX_NUMBER))
        assert abs(sent - wanted) <= 0.5000001 * 10.0**-places + 1e-15 * abs(wanted)
        assert re.fullmatch(r"-?(0|[1-9]\d*)\.(\d|\d+[1-9])", digits) and digits != "-0.0"
        assert len(digits.split(".")[1]) <= places


def test_a_template_needs_a_number_of_decimals_for_each_number():
    with pytest.raises(ValueError, match="broadcast"):
        JsonTemplate([MARK, MARK], np.array([1, 2, 3]))


@pytest.mark.slow
@given(SEEDS, st.sampled_from([np.nan, np.inf, -np.inf, 1e300]))
def test_no_output_sends_numbers_that_are_not_finite(seed, bad):
    frame = random_frame(seed)
    for pose in frame.poses:
        pose.positions[:] = bad
    for body in frame.performers.values():
        body.joints[:] = bad
    for output in (VmcOutput(), OscOutput(), VrchatOutput()):
        for values in messages(output.encode_packets(frame)).values():
            assert np.isfinite(np.array(values, float)).all()
    text = RokokoOutput(compress=False).encode_packets(frame)[0].decode()
    assert "null" not in text and json.loads(text, parse_constant=lambda word: pytest.fail(word))


def test_a_pose_of_another_version_of_its_character_is_left_out():
    frame = four_characters()
    short = replace(frame.poses[0], linear=frame.poses[0].linear[:3], positions=frame.poses[0].positions[:3])
    frame = replace(frame, poses=[short, *frame.poses[1:]])
    assert "anna" not in frame.rows.names and frame.find_human_character("anna") is None
    assert ("/VMC/Ext/Tra/Pos", "anna") not in messages(VmcOutput("ben").encode_packets(frame))


def test_unity_numbers_of_the_twin_are_those_of_the_protocol():
    assert unity_numbers(np.array([1.0, 2.0, 3.0]), np.array([0.5, 0.1, 0.2, 0.3])) == [
        *(-1.0, 2.0, 3.0, 0.1, -0.2, -0.3, 0.5)
    ]
