"""Tests that a later start removes only the temporary files of killed processes."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from enliven.errors import ResourceError
from enliven.files import TemporaryFolder, remove_dead_folders
from enliven_edge.network.name_lock import NameLock

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="the locks are those of POSIX")
HOLDS = """
import sys, time
from enliven.errors import ResourceError
from enliven.files import TemporaryFolder
from enliven_edge.network.name_lock import NameLock
folder, lock = TemporaryFolder("replay"), NameLock("run-1")
open(folder.name + "/take.mcap", "w").write("x" * 1000)
print(folder.name, flush=True)
time.sleep(60)
"""


@pytest.fixture
def temporary(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    monkeypatch.setenv("XDG_RUNTIME_DIR", "")
    return tmp_path


def locks(temporary: Path) -> list[str]:
    return sorted(path.name for path in (temporary / f"enliven-{os.getuid()}").glob("*"))


def test_leftovers_of_killed_process_are_removed_at_next_start(temporary: Path) -> None:
    with subprocess.Popen([sys.executable, "-c", HOLDS], stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        left = Path(process.stdout.readline().strip())
        assert remove_dead_folders() == [] and (left / "take.mcap").exists(), "its process lives"
        other = NameLock("run-2")
        assert locks(temporary) == ["enliven-edge-run-1.lock", "enliven-edge-run-2.lock"]
        process.send_signal(signal.SIGKILL)
    with TemporaryFolder("replay") as own:
        assert not left.exists() and Path(own).exists()
    third = NameLock("run-3")
    assert locks(temporary) == ["enliven-edge-run-2.lock", "enliven-edge-run-3.lock"]
    other.close()
    third.close()
    assert locks(temporary) == [] and [path.name for path in temporary.iterdir()] == [
        f"enliven-{os.getuid()}"
    ]


def test_links_and_folders_of_others_stay(temporary: Path, tmp_path_factory: pytest.TempPathFactory) -> None:
    precious = tmp_path_factory.mktemp("precious")
    (precious / "work").write_text("years")
    long_ago = time.time() - 1e6
    os.utime(precious, (long_ago, long_ago))
    (temporary / "enliven-capture-link").symlink_to(precious)
    for name in ("enliven-capture-new", "enliven-capture-old", "somebody-else"):
        (temporary / name).mkdir()
    (temporary / "enliven-capture-old" / "link").symlink_to(precious)
    for name in ("enliven-capture-old", "somebody-else"):
        os.utime(temporary / name, (long_ago, long_ago))
    assert remove_dead_folders() == ["enliven-capture-old"]
    assert (precious / "work").exists() and len(list(temporary.iterdir())) == 3


def test_a_name_is_taken_once_while_others_start_and_end(temporary: Path) -> None:
    """Starts that remove unlocked files never allow two processes to hold the same name."""
    again = "import sys; from enliven_edge.network.name_lock import NameLock\n"
    again += "for i in range(300): NameLock(f'run-{sys.argv[1]}-{i}').close()"
    others = [subprocess.Popen([sys.executable, "-c", again, str(n)]) for n in range(2)]
    lock = NameLock("stage")
    for _ in range(200):
        with pytest.raises(ResourceError, match="runs on this machine already"):
            NameLock("stage")
        NameLock("free").close()
    assert [process.wait(60) for process in others] == [0, 0]
    lock.close()
    assert locks(temporary) == []
