"""Tests of the edges' settings files: every shipped file is loaded, and its sensors can be opened and
placed.
"""

import contextlib
from pathlib import Path

import pytest
import typer

from enliven.errors import InputError
from enliven.settings import load_settings
from enliven.space.space_file import load_space
from enliven_edge.commands.edge import edge, load_edge_settings
from enliven_edge.fusion.live.fused_sensor import FusedSensors
from enliven_edge.settings import EdgeSettings, WireSettings
from enliven_edge.sources import Source, SourceSettings, open_sources, parse_source, sources_from_settings
from enliven_edge.tracking.settings import SceneSettings
from enliven_edge.tracking.tracker import Tracker

EDGES = Path(__file__).resolve().parents[2] / "firmware_configs" / "edges"
FILES = sorted(EDGES.glob("*.toml"))


def test_settings_files_are_shipped():
    assert {"laptop", "ceiling", "two-sensors"} <= {path.stem for path in FILES}


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_a_shipped_file_is_loaded(path):
    loaded = load_settings(EdgeSettings, path)
    assert loaded != EdgeSettings()
    assert bool(loaded.space) == (len(loaded.sensors) > 1)


@pytest.mark.slow
def test_shipped_two_sensor_settings_give_a_fused_sensor():
    path = EDGES / "two-sensors.toml"
    loaded = load_settings(EdgeSettings, path)
    space = load_space(path.parent / loaded.space)
    sources = sources_from_settings(loaded.sensors, path.parent)
    assert [source.name for source in sources] == ["left", "right"]
    assert sources[1].scene == SceneSettings(far=4.0)
    with contextlib.ExitStack() as stack:
        sensors = open_sources(sources, stack)
        trackers = {name: Tracker(loaded.tracker) for name in sensors}
        fused = stack.enter_context(FusedSensors(sensors, trackers, space, loaded.fusion))
        assert fused.name == "left + right"
        frame = fused.read(30.0)
    assert frame is not None and frame.read_ns > 0


def test_a_sensor_that_the_space_does_not_know_is_refused():
    loaded = load_settings(EdgeSettings, EDGES / "two-sensors.toml")
    space = load_space(EDGES / loaded.space)
    with contextlib.ExitStack() as stack:
        sensors = open_sources([Source("middle", "synthetic", {})], stack)
        with pytest.raises(InputError, match=r"no pose of the sensor .middle.*left, right"):
            FusedSensors(sensors, {"middle": Tracker()}, space)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[sensors]\nleft = 3", "sensors.left must be a table"),
        ("sensors = 3", "sensors must contain tables"),
        ('[sensors.left]\nsensr = "oak"', "Did you mean sensors.left.sensor"),
        ("[sensors.left.scene]\nfar = 99.0", "sensors.left.scene.far is 99.0, outside"),
        ("[sensors.left]\noptions = { path = [1] }", "sensors.left.options"),
    ],
)
def test_a_wrong_file_is_refused(tmp_path, text, message):
    path = tmp_path / "edge.toml"
    path.write_text(text)
    with pytest.raises(InputError, match=message.replace("[", r"\[")):
        load_settings(EdgeSettings, path)


def test_source_words_are_parsed(tmp_path):
    take = tmp_path / "a=b.mcap"
    take.touch()
    options = {"seed": 3, "left.width": 320, "right.width": 160}
    assert parse_source("synthetic", options) == Source(None, "synthetic", {"seed": 3})
    assert parse_source("left=synthetic", options) == Source("left", "synthetic", {"seed": 3, "width": 320})
    assert parse_source(str(take), {}, {"speed": 0.0}) == Source(
        None, "replay", {"speed": 0.0, "path": str(take)}
    )
    assert parse_source(f"left={take}", {}).name == "left"
    with pytest.raises(InputError, match=r"neither a sensor nor a recording.*Did you mean synthetic"):
        parse_source("sinthetic", {})


def test_a_sensor_of_a_package_that_is_not_installed_names_the_package(monkeypatch):
    monkeypatch.setattr("enliven_edge.sensors.registry.entry_points", lambda group: [])
    with pytest.raises(InputError, match=r"neither a sensor nor a recording.*pip install enliven-synthesis"):
        parse_source("synthetic", {})


def test_two_sensors_of_one_name_are_refused():
    with contextlib.ExitStack() as stack, pytest.raises(InputError, match="Give each sensor another name"):
        open_sources([Source(None, "synthetic", {})] * 2, stack)


def test_a_recordings_path_counts_from_the_file(tmp_path):
    tables = {"a": SourceSettings(options={"path": "a.mcap"})}
    assert sources_from_settings(tables, tmp_path)[0].options["path"] == str(tmp_path / "a.mcap")
    assert sources_from_settings(tables)[0].options["path"] == "a.mcap"


def test_the_earlier_option_and_key_open_still_mean_insecure() -> None:
    app = typer.Typer()
    app.command()(edge)
    command = typer.main.get_command(app)
    for words in (["--open"], ["--insecure"]):
        assert command.make_context("edge", words).params["insecure"]
    assert load_settings(EdgeSettings, {"wire": {"open": True}}).wire.insecure


def test_an_option_of_the_network_keeps_the_other_values_and_warns_of_nothing(caplog) -> None:
    wire = load_edge_settings(None, port=6000, host="0.0.0.0").wire
    assert wire == WireSettings(port=6000, control_port=6001, host="0.0.0.0")
    assert not caplog.messages
