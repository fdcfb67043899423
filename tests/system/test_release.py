"""Tests of what `make release` builds and refuses. Installing the wheels takes minutes and a network."""

import importlib.util
import platform
import shutil
import subprocess
import sys
import zipfile
from email.parser import Parser
from pathlib import Path

import pytest

from enliven import cli

ROOT = Path(__file__).parents[2]
SPEC = importlib.util.spec_from_file_location("release", ROOT / "scripts" / "release.py")
release = importlib.util.module_from_spec(SPEC)
SPEC.loader.exec_module(release)
ITS = release.version()


@pytest.fixture(scope="module")
def archives(tmp_path_factory) -> Path:
    """Builds sdists and wheels of the two packages whose builds differ most."""
    if not (ROOT / ".git").exists():
        pytest.skip("this is no checkout of git, so nothing says which files belong to the packages")
    place = tmp_path_factory.mktemp("archives")
    for folder in ("edge", "viewer"):
        release.build(folder, place)
    return place


def metadata(archives: Path, package: str):
    """Returns the metadata of a wheel."""
    (wheel,) = archives.glob(f"{package}-*.whl")
    with zipfile.ZipFile(wheel) as archive:
        (name,) = (name for name in archive.namelist() if name.endswith(".dist-info/METADATA"))
        return Parser().parsestr(archive.read(name).decode())


@pytest.mark.slow
@pytest.mark.parametrize("folder", ["edge", "viewer"])
def test_archives_hold_the_files_of_the_checkout(archives, folder):
    release.check_files(folder, archives)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("package", "sibling"), [("enliven_edge", "enliven"), ("enliven_viewer", "enliven[compressed]")]
)
def test_a_wheel_from_an_sdist_requires_its_siblings_in_its_own_version(archives, package, sibling):
    about = metadata(archives, package)
    assert about["Version"] == ITS
    assert f"{sibling}=={ITS}" in about.get_all("Requires-Dist")
    assert about["License-File"] == "LICENSE"


@pytest.mark.slow
def test_a_wheel_without_a_file_is_refused(archives, tmp_path):
    for path in archives.iterdir():
        shutil.copy(path, tmp_path)
    (wheel,) = tmp_path.glob("enliven_edge-*.whl")
    with zipfile.ZipFile(wheel) as archive:
        contents = {name: archive.read(name) for name in archive.namelist()}
    del contents["enliven_edge/firmware_configs/sensors/kinect1.toml"]
    contents["enliven_edge/notes.txt"] = b""
    with zipfile.ZipFile(wheel, "w") as archive:
        for name, data in contents.items():
            archive.writestr(name, data)
    with pytest.raises(
        release.ReleaseError, match=r"missing files: .*kinect1.toml.*unexpected files: .*notes.txt"
    ):
        release.check_files("edge", tmp_path)


@pytest.mark.slow
def test_an_sdist_builds_the_wheel_of_the_checkout(archives, tmp_path):
    release.check_sdist_wheel("edge", archives)
    (wheel,) = archives.glob("enliven_edge-*.whl")
    shutil.copy(wheel, tmp_path)
    with zipfile.ZipFile(tmp_path / wheel.name, "a") as archive:
        archive.writestr("enliven_edge/only_in_sdist.py", b"")
    with pytest.raises(release.ReleaseError, match=r"differ in the files .*only_in_sdist.py"):
        release.check_sdist_wheel("edge", tmp_path)


@pytest.mark.parametrize(
    ("words", "machine"), [({}, platform.machine()), ({"ENLIVEN_KERNELS_MACHINE": "aarch64"}, "aarch64")]
)
def test_compiled_kernels_go_into_a_wheel_of_their_platform(tmp_path, words, machine):
    kernels = tmp_path / "compiled"
    kernels.mkdir()
    (kernels / "step-0123.kernel").write_bytes(b"machine code")
    (kernels / "step-4567.part").write_bytes(b"unfinished")
    release.build_wheel("kernels", tmp_path / "filled", ENLIVEN_KERNELS=str(kernels), **words)
    release.build_wheel("kernels", tmp_path / "empty", **words)
    (filled,), (empty,) = (tmp_path / "filled").iterdir(), (tmp_path / "empty").iterdir()
    files = {"enliven_kernels/__init__.py", "enliven_kernels/kernels/step-0123.kernel"}
    assert release.list_wheel_files(filled) == files
    assert release.list_wheel_files(empty) == {"enliven_kernels/__init__.py"}
    version = f"cp{sys.version_info.major}{sys.version_info.minor}"
    assert f"-{version}-{version}-" in filled.name, "byte code differs between versions of Python"
    assert filled.name.endswith(f"_{machine}.whl")
    assert empty.name.endswith("-py3-none-any.whl"), "pip takes it where no other wheel fits"


@pytest.mark.slow
def test_the_extra_oak_is_in_the_wheel(archives):
    about = metadata(archives, "enliven_edge")
    assert "oak" in about.get_all("Provides-Extra")
    assert any(line.startswith("depthai==3") and "'oak'" in line for line in about.get_all("Requires-Dist"))


@pytest.mark.parametrize("words", [release.EDGE, release.FILM])
def test_command_lines_of_the_trial_have_known_options(words, capsys):
    assert cli.run([*words, "--help"]) == 0
    assert cli.run([*words, "--no-such-option", "--help"]) == 2


def test_every_package_has_the_version_of_the_source():
    from enliven import __version__

    assert __version__ == ITS, "the packages are installed in an older version: make setup-dev"
    done = subprocess.run(
        ["git", "-C", ROOT, "grep", "-l", "^version = ", "*pyproject.toml"], capture_output=True, text=True
    )
    assert set(done.stdout.split()) <= {"docs/example-sensor/pyproject.toml"}


def test_each_folder_has_its_own_copy_of_what_an_sdist_needs():
    licence = (ROOT / "LICENSE").read_text()
    hooks = []
    for folder in release.PACKAGES:
        assert (ROOT / folder / "LICENSE").read_text() == licence
        if folder not in ("shared", "kernels"):
            text = (ROOT / folder / "hatch_build.py").read_text()
            hooks.append(text[text.index("class SiblingVersions") :])
    assert len(set(hooks)) == 1


CHANGELOG = """# Changelog

## [Unreleased]

## [0.3.0] - 2027-01-02

### Added

- A thing.

## [0.2.0] - 2026-12-01

- Another.
"""


def test_the_notes_are_the_section_of_the_version():
    assert release.section(CHANGELOG, "0.3.0") == "### Added\n\n- A thing.\n"
    assert release.section(CHANGELOG, "0.2.0") == "- Another.\n"


@pytest.mark.parametrize("of", ["0.4.0", "0.2", "0.4.0.dev0"])
def test_a_version_without_notes_is_refused(of):
    with pytest.raises(release.ReleaseError, match="has no changes for"):
        release.section(CHANGELOG, of)


@pytest.fixture
def repository(tmp_path, monkeypatch):
    """Creates a repository with one commit and makes the script use it as the checkout."""

    def git(*words: str) -> None:
        who = ["-c", "user.name=a", "-c", "user.email=a@b", "-c", "commit.gpgsign=false"]
        subprocess.run(["git", *who, *words], cwd=tmp_path, check=True, capture_output=True)

    (tmp_path / "VERSION").write_text("0.3.0\n")
    git("init", "-q")
    git("add", "-A")
    git("commit", "-qm", "All")
    monkeypatch.setattr(release, "ROOT", tmp_path)
    return tmp_path, git


def test_a_release_is_of_a_commit_with_its_tag(repository):
    folder, git = repository
    release.check_commit("0.3.0.dev0")
    with pytest.raises(release.ReleaseError, match=r"no tag v0.3.0. Run: git tag -a v0.3.0"):
        release.check_commit("0.3.0")
    git("tag", "-a", "v0.3.0", "-m", "enliven 0.3.0")
    release.check_commit("0.3.0")
    (folder / "VERSION").write_text("0.4.0\n")
    with pytest.raises(release.ReleaseError, match="uncommitted changes"):
        release.check_commit("0.3.0")
