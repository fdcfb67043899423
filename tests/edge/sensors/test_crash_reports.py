"""Tests that crashes of a camera's program or library leave a report of bounded size, which the doctor
lists.
"""

import importlib.util
import re

import pytest
from contract import next_frame
from isolated_sensors import none_left, opener  # noqa: F401 (a fixture)

from enliven_edge import doctor
from enliven_edge.sensors import crash_reports
from enliven_edge.sensors.base import SensorFault
from enliven_edge.sensors.drivers.oak import store_crash_dump


@pytest.fixture(autouse=True)
def state(tmp_path, monkeypatch):
    """Returns the user's state folder."""
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    return tmp_path / "state" / "enliven" / "crashes"


def crashed(folder) -> None:
    """Runs a library that crashes at its second image."""
    folder.mkdir()
    with opener(folder, mishap="crashes", after=2)() as sensor:
        next_frame(sensor)
        with pytest.raises(SensorFault, match="crashed"):
            while True:
                sensor.read(1.0)


def test_library_crash_is_located_and_repeats_are_counted(tmp_path):
    assert doctor.list_crash_reports().detail == "none stored"
    for name in ("first", "second"):
        crashed(tmp_path / name)
    (report,) = crash_reports.list_stored_reports()
    text = report.path.read_text()
    assert "Segmentation fault" in text and re.search(r'wild\.py", line \d+ in read', text)
    assert "sensor wild, signal 11" in text and "seen 2 times" in text


def test_crash_dump_of_an_oak_is_kept_unchanged(state):
    """The dump has the library's own format. Only the device that delivers it is simulated."""
    if importlib.util.find_spec("depthai") is None:
        pytest.skip('depthai is not installed: pip install "./edge[oak]"')
    import depthai as dai

    class Device:
        dumps = 1

        def hasCrashDump(self):
            return self.dumps > 0

        def getCrashDump(self):
            self.dumps -= 1
            dump = dai.CrashDumpRVC2()
            dump.deviceId = "18443010/../x"
            return dump

    device = Device()
    assert all(
        callable(getattr(dai.Device, name)) for name in ("hasCrashDump", "getCrashDump", "getDeviceId")
    )
    for _ in range(2):
        store_crash_dump(device)
    (report,) = crash_reports.list_stored_reports()
    assert report.path.parent == state
    assert dai.CrashDump.load(str(report.path)).deviceId == "18443010/../x"
    assert re.search(
        r"oak-firmware-18443010_.._x-.*gz, \d{4}-\d\d-\d\d \d\d:\d\d: .* https://discuss\.luxonis\.com",
        doctor.list_crash_reports().detail,
    )
    assert doctor.list_crash_reports().ok, "a report is no lack of the machine"


def test_the_newest_are_kept_within_a_number_and_a_size(monkeypatch, state):
    for number in range(crash_reports.MAX_REPORTS + 5):
        crash_reports.keep_dump(f"{number:03}", lambda path: path.write_bytes(b"x" * 1000))
    names = [report.path.name for report in crash_reports.list_stored_reports()]
    assert len(names) == crash_reports.MAX_REPORTS and names[0].startswith("oak-firmware-024")
    monkeypatch.setattr(crash_reports, "MAX_TOTAL_BYTES", 5000)
    (state / "of_the_library").mkdir()
    (state / "of_the_library" / "crash_dump_7.tar.gz").write_bytes(b"y" * 4500)
    crash_reports.remove_old_reports()
    assert [report.path.name for report in crash_reports.list_stored_reports()] == ["crash_dump_7.tar.gz"]


def test_unwritable_state_folder_is_only_logged(state, caplog):
    state.parent.mkdir(parents=True)
    state.write_text("a file in its place")
    crash_reports.keep_text("oak", "Fatal Python error: Aborted", 6)
    assert "cannot be saved" in caplog.text and crash_reports.list_stored_reports() == []
