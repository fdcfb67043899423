"""Tests that the driver in docs/add-a-sensor.md, installed like by a user, runs in the edge."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from enliven.errors import InputError
from enliven_edge.sensors.registry import open_sensor

EXAMPLE = Path(__file__).parents[3] / "docs" / "example-sensor"


def test_the_example_is_short():
    lines = sum(len(path.read_text().splitlines()) for path in EXAMPLE.iterdir() if path.is_file())
    assert lines < 60


def test_class_that_is_not_a_sensor_is_refused_with_advice(tmp_path, monkeypatch):
    about = tmp_path / "loose_wall-1.0.dist-info"
    about.mkdir()
    (tmp_path / "loose_wall.py").write_text("class LooseWall:\n    name = 'loose wall'\n")
    (about / "METADATA").write_text("Metadata-Version: 2.1\nName: loose-wall\nVersion: 1.0\n")
    (about / "entry_points.txt").write_text("[enliven.sensors]\nloose-wall = loose_wall:LooseWall\n")
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(InputError, match=r"loose_wall:LooseWall is not a subclass.*class NAME\(Sensor\)"):
        open_sensor("loose-wall")


@pytest.mark.slow
def test_example_sensor_is_installed_and_runs(tmp_path):
    install = ["-m", "pip", "install", "-q", "--no-deps", "--no-build-isolation", "--no-index"]
    subprocess.run(
        [sys.executable, *install, "--target", str(tmp_path / "site"), str(EXAMPLE)],
        check=True,
        capture_output=True,
        timeout=300,
    )
    code = "\n".join(
        [
            "from enliven_edge.sensors.registry import open_sensor, sensor_names",
            "if __name__ == '__main__':",
            "    assert 'pulsing-wall' in sensor_names()",
            "    with open_sensor('pulsing-wall', serial='7', fps=90.0) as sensor:",
            "        frames = [sensor.read(30.0) for _ in range(20)]",
            "        print(sensor.name, len({int(f.depth[0, 0]) for f in frames}), frames[0].sequence)",
        ]
    )
    script = tmp_path / "use.py"
    script.write_text(code)
    path = os.pathsep.join([str(tmp_path / "site"), os.environ.get("PYTHONPATH", "")])
    result = subprocess.run(
        [sys.executable, str(script)],
        env={**os.environ, "PYTHONPATH": path},
        check=False,
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert result.returncode == 0, result.stderr
    name, distances, first = result.stdout.rsplit(maxsplit=2)
    assert name == "pulsing-wall 7" and int(distances) > 5 and first == "1"
