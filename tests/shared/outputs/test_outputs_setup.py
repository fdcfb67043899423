"""Tests that invalid outputs are refused at the start, with messages that name the position and the
remedy.
"""

import socket

import pytest

from enliven import doctor
from enliven.errors import InputError, ResourceError
from enliven.outputs import vmc, vrchat
from enliven.outputs.address import OutputAddress, parse_address, resolve
from enliven.outputs.opening import open_outputs
from enliven.outputs.registry import OUTPUTS
from enliven.outputs.settings import LiveOutputSettings, collect_output_settings
from enliven.settings import load_settings
from enliven_edge.settings import EdgeSettings

PORTS = {scheme: protocol.port for scheme, protocol in OUTPUTS.items()}


@pytest.mark.parametrize(
    ("text", "parts"),
    [
        ("vmc:127.0.0.1", ("vmc", "127.0.0.1", 39539, "")),
        ("VMC:studio.local:5", ("vmc", "studio.local", 5, "")),
        ("vrchat:headset", ("vrchat", "headset", 9000, "")),
        ("rokoko:192.168.1.5", ("rokoko", "192.168.1.5", 14043, "")),
        ("osc:[::1]:7000", ("osc", "::1", 7000, "")),
        ("vmc:[fe80::1]", ("vmc", "fe80::1", 39539, "")),
        ("vmc:localhost:39540/my model", ("vmc", "localhost", 39540, "my model")),
        ("vmc:localhost/performer-2", ("vmc", "localhost", 39539, "performer-2")),
    ],
)
def test_an_address_is_parsed(text, parts):
    address = parse_address(text, PORTS, "--out")
    assert address == OutputAddress(*parts)
    assert parse_address(str(address), PORTS, "--out") == address


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            "vcm:127.0.0.1",
            r"--out vcm:127\.0\.0\.1: the output protocol 'vcm' is unknown.*Did you mean vmc\?.*osc",
        ),
        ("fbx:127.0.0.1", r"protocol 'fbx' is unknown.*Known protocols: vmc, vrchat, rokoko, osc, foxglove"),
        ("127.0.0.1", r"is not the address of an output.*SCHEME:HOST"),
        ("vmc:", r"is not the address of an output"),
        ("", r"is not the address of an output"),
        ("vmc:127.0.0.1:http", r"'http' is not a valid port.*1 to 65535.*39539"),
        ("vmc:127.0.0.1:0", r"'0' is not a valid port"),
        ("vmc:127.0.0.1:65536", r"'65536' is not a valid port"),
        ("vmc:127.0.0.1:99999999999999", r"is not a valid port"),
        ("vmc:127.0.0.1:", r"'' is not a valid port"),
        ("vmc:no-such-host.invalid", r"the host 'no-such-host\.invalid' was not found.*IP address"),
        (f"vmc:{'a' * 300}", r"was not found"),
        ("osc:127.0.0.1/anna", r"always sends everything.*Remove /anna"),
        ("vrchat:127.0.0.1/anna", r"vrchat can send only performers, and 'anna'.*performer-1"),
        ("vmc:127.0.0.1/performer-0", r"not the name of a performer.*performer-1"),
        ("vrchat:127.0.0.1/performer-x", r"not the name of a performer"),
    ],
)
def test_a_wrong_address_is_refused(text, message):
    with pytest.raises(InputError, match=message):
        open_outputs(collect_output_settings([text], {}))


def test_the_same_receiver_twice_is_refused():
    twice = {"desk": LiveOutputSettings("osc:127.0.0.1:7000")}
    with pytest.raises(
        InputError, match=r"--out osc:127\.0\.0\.1:7000.*same output as outputs\.desk.*another port"
    ):
        open_outputs(collect_output_settings(["osc:127.0.0.1:7000"], twice))
    with pytest.raises(InputError, match="same output as"):
        open_outputs(collect_output_settings(["vmc:localhost/anna", "vmc:127.0.0.1"], {}))
    with pytest.raises(InputError, match="same output as"):
        open_outputs(collect_output_settings(["vmc:127.0.0.1", "vmc:127.0.0.1"], {}))
    with open_outputs(collect_output_settings(["vmc:127.0.0.1:7000", "osc:127.0.0.1:7000"], {})) as outputs:
        assert len(outputs.statuses) == 2, "two protocols are two outputs"


def test_a_failed_start_leaves_no_thread():
    import threading

    before = threading.active_count()
    with pytest.raises(InputError):
        open_outputs(collect_output_settings(["vmc:127.0.0.1", "vmc:127.0.0.1:x"], {}))
    assert threading.active_count() == before


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        (
            {"to": "vmc:127.0.0.1", "height": 1.7},
            r"outputs\.x: the key height does not apply to the protocol vmc",
        ),
        (
            {"to": "vrchat:127.0.0.1", "map": "a.toml"},
            "map does not apply to the protocol vrchat.*height, to",
        ),
        ({"to": "osc:127.0.0.1", "compress": False}, "compress does not apply to the protocol osc"),
        ({"to": "osc:127.0.0.1", "map": "missing.toml"}, r"missing\.toml"),
    ],
)
def test_keys_of_another_protocol_are_refused(keys, message, tmp_path):
    with pytest.raises(InputError, match=message):
        open_outputs({"x": LiveOutputSettings(**keys)}, tmp_path)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('[addresses]\n"/light" = "/x"', r"'/light' = '/x' does not rename.*/enliven/"),
        ('[addresses]\n"/enliven/time" = "x"', "does not rename an address"),
        ('[addresses]\n"/enliven/time" = "/a b"', "does not rename an address"),
        ('[addresses]\n"/enliven/time" = "/Bühne"', "does not rename an address.*printable ASCII"),
        ('[addresses]\n"/enliven/time" = "/{0}"', "does not rename an address"),
        ('[addresses]\n"/enliven/performer/*/height" = "/*/*"', r"contains more \* than"),
        ("adresses = 1", r"adresses.*Did you mean addresses\?"),
        ("[addresses]\nx", "not valid TOML"),
    ],
)
def test_a_wrong_mapping_file_is_refused(text, message, tmp_path):
    (tmp_path / "map.toml").write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match=message):
        open_outputs({"x": LiveOutputSettings("osc:127.0.0.1", map="map.toml")}, tmp_path)


def test_a_missing_library_is_named(monkeypatch):
    monkeypatch.setattr(doctor.importlib.util, "find_spec", lambda name: None)
    with pytest.raises(ResourceError, match=r"pythonosc.*enliven\[outputs\]"):
        open_outputs(collect_output_settings(["vmc:127.0.0.1"], {}))
    with pytest.raises(ResourceError, match=r"lz4.*enliven\[outputs\]"):
        open_outputs(collect_output_settings(["rokoko:127.0.0.1"], {}))


def test_settings_and_command_line_are_joined():
    text = {
        "outputs": {"avatar": {"to": "vmc:127.0.0.1"}, "headset": {"to": "vrchat:10.0.0.9", "height": 1.6}}
    }
    settings = load_settings(EdgeSettings, text).outputs
    with open_outputs(collect_output_settings(["osc:127.0.0.1:7000"], settings)) as outputs:
        names = [status.name for status in outputs.statuses]
    assert names == ["vmc:127.0.0.1:39539", "vrchat:10.0.0.9:9000", "osc:127.0.0.1:7000"]


def test_default_ports_are_those_of_the_protocols():
    assert (OUTPUTS["vmc"].port, OUTPUTS["vrchat"].port) == (vmc.PORT, vrchat.PORT)
    assert resolve(parse_address("vmc:localhost", PORTS, ""), "")[0] == socket.AF_INET
