"""Tests of the settings files of controls: every shipped file is loaded, and its controls can be created."""

from pathlib import Path

import pytest

from enliven.errors import InputError, ResourceError
from enliven.settings import load_settings
from enliven_edge.controls.base import Device
from enliven_edge.controls.control_set import commands_by_key, create_device
from enliven_edge.settings import EdgeSettings

FILES = sorted((Path(__file__).resolve().parents[3] / "firmware_configs" / "controls").glob("*.toml"))


def test_shipped_settings_cover_every_control_kind():
    kinds = {
        control.kind for path in FILES for control in load_settings(EdgeSettings, path).controls.values()
    }
    assert kinds == {"serial", "hid", "voice"}


def test_the_shipped_udev_rules_open_the_shipped_hid_controls():
    rules = (FILES[0].parents[1] / "udev" / "60-enliven-controls.rules").read_text()
    lines = [line for line in rules.splitlines() if line.startswith("KERNELS")]
    assert all('MODE="0660"' in line and 'TAG+="uaccess"' in line for line in lines)
    opened = " ".join(lines)
    hid = [c for f in FILES for c in load_settings(EdgeSettings, f).controls.values() if c.kind == "hid"]
    assert hid and all(f'KERNELS=="*:{c.vendor:04X}:{c.product:04X}.*"' in opened for c in hid)


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_a_shipped_file_makes_its_controls(path):
    controls = load_settings(EdgeSettings, path).controls
    assert controls
    for name, settings in controls.items():
        assert commands_by_key(name, settings)
        try:
            assert isinstance(create_device(name, settings), Device)
        except ResourceError as error:
            pytest.skip(str(error))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('[controls.pedal]\nkind = "pedal"', "controls.pedal.kind is 'pedal'"),
        ('[controls.pedal]\nport = "x"', "controls.pedal.kind is missing"),
        ('[controls.pedal]\nkind = "serial"\nbaudrate = 9600', "Did you mean controls.pedal.baud"),
        ('[controls.pedal]\nkind = "hid"\nvendor = 99999', "controls.pedal.vendor is 99999, outside"),
        ('[controls.pedal]\nkind = "serial"\nmap = { A = 3 }', "controls.pedal.map"),
    ],
)
def test_a_wrong_file_is_refused(tmp_path, text, message):
    path = tmp_path / "edge.toml"
    path.write_text(text)
    with pytest.raises(InputError, match=message):
        load_settings(EdgeSettings, path)
