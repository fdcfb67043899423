"""Tests of settings: defaults, overrides, and messages that name the nearest known key."""

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import ClassVar, Literal

import pytest

from enliven.errors import InputError
from enliven.example_sessions.tables import SettingsTable
from enliven.settings import group, load_settings, parameter, setting
from enliven_edge.settings import EdgeSettings


@dataclass(frozen=True)
class Lens:
    focal: float = setting(500.0, "Focal length.", unit="px", low=1.0, high=5000.0)
    kind: Literal["pinhole", "fisheye"] = setting("pinhole", "Model.")


@dataclass(frozen=True)
class Camera:
    name: str = setting(doc="The name is needed.")
    lens: Lens = group(Lens, "The lens.")
    rows: tuple[float, ...] = setting((), "Some rows.")
    limit: int | None = setting(None, "A limit.")


def test_defaults_and_overrides():
    camera = load_settings(Camera, {"name": "a", "lens": {"focal": 600}, "rows": [1, 2.5], "limit": 3})
    assert camera == Camera("a", Lens(600.0), (1.0, 2.5), 3)
    assert load_settings(Camera, {"name": "a"}) == Camera("a")


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"nmae": "a"}, "unknown key nmae.*Did you mean name"),
        ({"name": "a", "lens": {"focl": 1}}, r"unknown key lens\.focl.*Did you mean lens\.focal"),
        ({"name": "a", "zzzz": 1}, "Known keys: name, lens"),
        ({}, "key name is missing.*The name is needed"),
        ({"name": 3}, "name is 3, expected str"),
        ({"name": "a", "lens": {"focal": "wide"}}, r"lens\.focal is 'wide', expected float"),
        (
            {"name": "a", "lens": {"focal": 0.5}},
            r"lens\.focal is 0\.5, outside the range 1\.0\.\.5000\.0 px",
        ),
        ({"name": "a", "lens": {"focal": float("nan")}}, r"lens\.focal is nan"),
        ({"name": "a", "lens": {"kind": "mirror"}}, r"lens\.kind is 'mirror'"),
        ({"name": "a", "lens": 4}, "lens must be a table"),
        ({"name": "a", "rows": [1, "b"]}, "rows is"),
        ({"name": "a", "rows": [1.0, float("inf")]}, "rows is"),
        ({"name": "a", "limit": True}, "limit is True"),
    ],
)
def test_invalid_setting_is_reported(values, message):
    with pytest.raises(InputError, match=message):
        load_settings(Camera, values, where="camera.toml")


def test_settings_files_are_read(tmp_path):
    path = tmp_path / "edge.toml"
    with pytest.raises(InputError, match="the file does not exist"):
        load_settings(EdgeSettings, path)
    path.write_text("nodes = [")
    with pytest.raises(InputError, match="not valid TOML"):
        load_settings(EdgeSettings, path)
    path.write_text("nodes = 64\n[tracker.smoothing]\namount = 0.0\n")
    loaded = load_settings(EdgeSettings, path)
    assert loaded.nodes == 64
    assert loaded.tracker.smoothing.amount == 0.0
    assert loaded.actor == EdgeSettings().actor


def test_every_setting_of_the_edge_is_explained():
    import dataclasses

    def walk(kind):
        for field in dataclasses.fields(kind):
            assert field.metadata["doc"], f"{kind.__name__}.{field.name}"
            if dataclasses.is_dataclass(field.default_factory):
                walk(field.default_factory)

    walk(EdgeSettings)


def test_every_shipped_file_of_the_edge_loads(caplog):
    files = sorted((Path(__file__).parents[2] / "firmware_configs" / "edges").glob("*.toml"))
    assert {path.stem for path in files} >= {"laptop", "ceiling"}
    names = [load_settings(EdgeSettings, path).wire.name for path in files]
    assert names == [path.stem for path in files]
    assert not caplog.messages, "a shipped file contains a setting that no longer exists"


def test_a_session_keeps_every_value_that_decides_how_its_puppet_moves(caplog):
    kept = asdict(SettingsTable())
    kept["surface"]["follow"], kept["locomotion"]["contact"]["rise"] = 0.125, 0.25
    loaded = load_settings(SettingsTable, kept)
    assert asdict(loaded) == kept and not caplog.messages


def test_an_earlier_name_of_a_key_is_still_read() -> None:
    @dataclass(frozen=True)
    class Renamed:
        insecure: bool = setting(False, "Uses no keys.", formerly="open")
        other: int = setting(1, "Another.")

    assert load_settings(Renamed, {"open": True}).insecure and not load_settings(Renamed, {}).insecure
    assert not load_settings(Renamed, {"open": True, "insecure": False}).insecure
    with pytest.raises(InputError, match="insecure is 7"):
        load_settings(Renamed, {"open": 7})


@dataclass(frozen=True)
class Shutter:
    REMOVED_SETTINGS: ClassVar = ("blur", "leaf")

    speed: float = setting(0.01, "Exposure time.", low=0.0)
    gain: float = parameter(2.0, "Gain of the sensor.", low=0.0, high=9.0)


@dataclass(frozen=True)
class Body:
    shutter: Shutter = group(Shutter, "The shutter.")


def test_settings_that_no_longer_exist_are_ignored_with_one_sentence(caplog) -> None:
    old = {"shutter": {"speed": 0.5, "blur": "much", "leaf": {"width": 3}, "gain": 4.0}}
    assert load_settings(Body, old, where="old.toml") == Body(Shutter(speed=0.5))
    assert caplog.messages == [
        "old.toml: these settings no longer exist and are ignored: shutter.blur, shutter.leaf, shutter.gain. "
        "Delete them from the file."
    ]
    with pytest.raises(InputError, match=r"unknown key shutter\.lens"):
        load_settings(Body, {"shutter": {"lens": 1, "blur": 1}})


def test_files_of_enliven_itself_keep_the_parameters_of_the_code(caplog) -> None:
    values = {"shutter": {"gain": 4.0, "blur": 1.0}}
    assert load_settings(Body, values, own_file=True) == Body(Shutter(gain=4.0))
    assert not caplog.messages
    with pytest.raises(InputError, match=r"gain is 10\.0, outside"):
        load_settings(Body, {"shutter": {"gain": 10.0}}, own_file=True)


def test_a_complete_file_of_version_0_1_opens_with_one_sentence(caplog) -> None:
    path = Path(__file__).parents[1] / "system" / "versions" / "0.1" / "edge.toml"
    load_settings(EdgeSettings, path)
    (message,) = caplog.messages
    assert "tracker.fit.temporal" in message and "fusion.gate" in message and str(path) in message
