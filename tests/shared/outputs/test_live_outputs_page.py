"""Tests that docs/live-outputs.md lists everything that is sent."""

import re
from pathlib import Path

import numpy as np
from live_scenes import four_characters
from pythonosc.osc_packet import OscPacket

from enliven.outputs.live_frame import LiveEvent, LiveFrame
from enliven.outputs.osc_tree import OscOutput, read_address_map
from enliven.outputs.registry import OUTPUTS
from enliven.outputs.vmc import VmcOutput

PAGE = (Path(__file__).parents[3] / "docs" / "live-outputs.md").read_text(encoding="utf-8")


def addresses(packets) -> set[str]:
    return {timed.message.address for packet in packets for timed in OscPacket(packet).messages}


def test_the_table_of_protocols_has_every_protocol_and_port():
    rows = re.findall(r"^\| `(\w+)` \| (\d+) \|", PAGE, re.MULTILINE)
    assert {name: int(port) for name, port in rows} == {name: row.port for name, row in OUTPUTS.items()}


def test_the_page_lists_every_address():
    events = [LiveEvent(kind, 1, "x" * (kind in ("possess", "release")))
              for kind in ("enter", "leave", "possess", "release")]  # fmt: skip
    frame = four_characters()
    frame = LiveFrame(0, frame.performers, frame.poses, frame.characters, frame.held, frame.props, events)
    for address in addresses(OscOutput().encode_packets(frame)):
        parts = address.split("/")
        general = re.sub(r"/performer/\d+", "/performer/N", address)
        general = re.sub(r"/character/\w+/", "/character/ID/", general)
        general = re.sub(r"/prop/\d+/", "/prop/NUMBER/", general)
        general = re.sub(r"/(joint|confidence)/\w+", r"/\1/JOINT", general)
        plain = general in PAGE or f"`{parts[-1]}`" in PAGE
        assert plain, address
        if parts[-2] == "joint":
            assert f"`{parts[-1].replace('right', 'left')}`" in PAGE, address
    for address in addresses(VmcOutput().encode_packets(frame)):
        assert f"`{address}`" in PAGE


def test_the_mapping_file_of_the_page_is_read(tmp_path):
    (text,) = re.findall(r"```toml\n(others.*?)```", PAGE, re.DOTALL)
    (tmp_path / "lights.toml").write_text(text)
    output = OscOutput(read_address_map(tmp_path / "lights.toml"))
    frame = four_characters()
    frame = LiveFrame(0, frame.performers, events=[LiveEvent("enter", 1)])
    sent = addresses(output.encode_packets(frame))
    assert sent == {"/spot/1/target", "/person/1/height", "/person/2/height", "/cue/enter"}
    assert np.all([len(packet) <= 1472 for packet in output.encode_packets(frame)])
