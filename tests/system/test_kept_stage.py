"""Tests that a viewer sees the same characters after the edge program was killed and restarted."""

from __future__ import annotations

import contextlib
import os
import subprocess
import sys
from pathlib import Path

import pytest
from patience import wait_until

from enliven.formats.project.one_character import project_of_mesh
from enliven.samples.shipped import load_sample
from enliven.wire import SIZES, Answer, Done, Endpoint, RemoveCharacter, Resize, free_ports
from enliven_viewer.link.edge_client import EdgeClient


@pytest.mark.slow
def test_killed_edge_shows_the_same_characters_again(tmp_path: Path) -> None:
    ports = free_ports()[:2]
    at = ["--port", str(ports[0]), "--control-port", str(ports[1]), "--name", f"kept-{ports[0]}"]
    command = [sys.executable, "-m", "enliven", "edge", "--sensor", "synthetic"]
    command += ["--set", "width=160", "--mesh", "chair", "--mesh", "lamp", *at]
    kept = tmp_path / f"stage-kept-{ports[0]}"

    def run() -> subprocess.Popen[bytes]:
        return subprocess.Popen(command, env={**os.environ, "STATE_DIRECTORY": str(tmp_path)})

    def shows(link: EdgeClient, names: set[str]) -> bool:
        link.poll()
        return set(link.characters) == names

    edge = run()
    try:
        with contextlib.closing(EdgeClient([Endpoint("127.0.0.1", *ports)])) as link:
            wait_until(lambda: shows(link, {"chair", "lamp"}), "the stage", 600.0)
            answers: list[Answer] = []
            project = project_of_mesh(load_sample("lamp"), "lamp")

            def is_put() -> bool:
                """Returns True if the character is on the stage. Sends it again if a busy edge did not answer
                in time.
                """
                link.poll()
                if not link.stage.is_uploading and Done() not in answers:
                    link.stage.put(project, "lamp", name="guest", then=answers.append)
                return Done() in answers

            wait_until(is_put, "the upload", 300.0)
            wait_until(lambda: shows(link, {"chair", "lamp", "guest"}), "the new character", 300.0)
            link.ask(RemoveCharacter("chair"))
            link.ask(Resize("set", "guest", size=1.5))
            wait_until(lambda: shows(link, {"lamp", "guest"}), "the removal")

            def is_written() -> bool:
                link.poll()
                return (kept / "stage.json").exists() and "1.5" in (kept / "stage.json").read_text()

            wait_until(is_written, "the state")
            shape = link.characters["guest"].vertices.copy()
        edge.kill()
        edge.wait()
        edge = run()
        with contextlib.closing(EdgeClient([Endpoint("127.0.0.1", *ports)])) as link:
            wait_until(lambda: shows(link, {"lamp", "guest"}), "the same characters", 300.0)
            assert link.characters["guest"].vertices.tobytes() == shape.tobytes()
            wait_until(lambda: link.poll() or "guest" in link.latest(SIZES), "its size")
            assert link.latest(SIZES)["guest"].size == pytest.approx(1.5)
    finally:
        edge.terminate()
        edge.wait(60)
