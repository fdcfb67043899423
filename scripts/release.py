"""Builds the release of this commit, and tests it in environments without the checkout: `make release`.

    .venv/bin/python scripts/release.py            # out/release: sdists, wheels, notes.md, trial.txt
    .venv/bin/python scripts/release.py --only oak # tests one of the environments only
    .venv/bin/python scripts/release.py --no-trial # builds and checks only, without a network

A version that ends in .dev0 (see the file VERSION) makes a development build. Any other version needs a
section in CHANGELOG.md, and the tag v<VERSION> on this commit.
"""

from __future__ import annotations

import argparse
import os
import platform
import re
import shutil
import subprocess
import sys
import tarfile
import tempfile
import time
import zipfile
from collections.abc import Iterator
from importlib.metadata import distributions
from pathlib import Path

ROOT = Path(__file__).parents[1]
PACKAGES = {
    "kernels": "enliven_kernels", "shared": "enliven", "edge": "enliven_edge", "viewer": "enliven_viewer",
    "synthesis": "enliven_synthesis",
}  # fmt: skip
"""The importable package of each distribution folder. Distributions that others depend on come first."""
EXTRA_SDIST_FILES = ("pyproject.toml", "README.md", "LICENSE", "hatch_build.py")
"""Files in addition to the package that an sdist has if they exist in the distribution's folder."""
FIRMWARE = "firmware_configs"
"""The folder next to the packages that belongs to enliven-edge."""
INSTALLS = {"edge": "enliven-edge", "oak": "enliven-edge[oak]", "studio": "enliven[studio]"}
"""Requirements that are installed, each into an empty environment, by the name of the environment."""
MAX_ENVIRONMENT_MB = {"edge": 678, "oak": 903, "studio": 916}
"""Maximum size of an environment in megabytes (10^6 bytes).

It includes byte code, but not Python and pip.

These limits are 5 % above the sizes of December 2026, which docs/releasing.md explains."""
LISTED_PACKAGES = 7
"""Number of packages that are listed with their sizes for each environment."""
EDGE = (
    *("edge", "--possess-at", "1", "--seconds", "3", "--speed", "0"),
    *("--port", "0", "--record", "performance.mcap"),
)
"""Arguments of the edge in the main job. The shipped recording moves the chair, and the performance is
recorded."""
FILM = ("run", "--film", "--size", "320x180", "--out", "film")
"""Arguments of a small version of the main job: an edge, and a viewer that films its output."""

EXAMPLES = (
    *("possess_chair", "legs_only", "made_mesh", "scan_and_possess", "canon", "cut_and_merge"),
    "key_poses",
)
"""Scripts of ``examples/`` that need no user files. They compile the kernels that the main job does not
use."""
CROSS_MACHINE = "aarch64"
"""Machine for which kernels are cross-compiled, as in the tags of wheels."""
CROSS_COMPILER = ROOT / "scripts" / "cross_kernels.py"
"""Program that compiles kernels for that machine."""
MAX_COMPILED_KERNELS = 0
"""Maximum number of kernels that an installed edge may compile in the main job. A release with shipped
kernels compiles none."""

OWN_FILES = """
import runpy, sys
from pathlib import Path
documents = Path(sys.argv[1], "tests", "documents")
runpy.run_path(str(documents / "conftest.py"))
sys.path += [str(documents.parent / "helpers"), sys.argv[1] + "/scripts"]
import own_files
own_files.make_own_files(Path.cwd())
"""
"""Program that creates the files with names in capitals in docs/library.md, in the working folder.

Argument: the checkout."""
LIBRARY_PAGE = """
import sys
from pathlib import Path
root, prefix = Path(sys.argv[1]), sys.argv[2]
sys.path.append(str(root / "tests" / "documents"))
import enliven, blocks
assert enliven.__file__.startswith(prefix), enliven.__file__
page = root / "docs" / "library.md"
names = {}
for block in blocks.blocks_of(page):
    exec(compile("\\n" * (block.line - 1) + block.text, str(page), "exec"), names)
"""
"""Program that runs the code of docs/library.md in the working folder.

Arguments: the checkout, the environment."""


class ReleaseError(Exception):
    """An error in the release. The message also says how to fix it."""


def version() -> str:
    """Returns the version of all packages: the only line of the file VERSION."""
    return (ROOT / "VERSION").read_text(encoding="utf-8").strip()


def is_development(of: str) -> bool:
    """Returns True if a version is a development version."""
    return ".dev" in of


def section(changelog: str, of: str) -> str:
    """Returns the changelog's lines for a version without their heading.

    For a development version, returns the unreleased lines.

    Raises:
        ReleaseError: if the section is missing or empty.
    """
    name = "Unreleased" if is_development(of) else of
    match = re.search(
        rf"^## \[{re.escape(name)}\][^\n]*\n(.*?)(?=^## \[|\Z)", changelog, re.MULTILINE | re.DOTALL
    )
    if not match or not match[1].strip():
        raise ReleaseError(f"CHANGELOG.md has no changes for {name}: write a section `## [{name}]`.")
    return match[1].strip() + "\n"


def check_commit(of: str) -> None:
    """Checks that the working files are exactly those of a tagged commit.

    Raises:
        ReleaseError: if files are changed or new, or the tag is missing or on another commit.
    """
    changed = _list_with_git("status", "--porcelain")
    if changed:
        raise ReleaseError(f"there are files with uncommitted changes. Commit these files first:\n{changed}")
    tag = f"v{of}"
    if not is_development(of) and tag not in _list_with_git("tag", "--points-at", "HEAD").split():
        raise ReleaseError(f"this commit has no tag {tag}. Run: git tag -a {tag} -m 'enliven {of}'")


def build(folder: str, into: Path) -> None:
    """Builds a package's sdist, and builds its wheel from that sdist.

    This shows that the sdist is complete.
    """
    command = [sys.executable, "-m", "hatchling", "build", "-t", "sdist", "-d", str(into)]
    _require(command, f"{folder}: the sdist cannot be built", ROOT / folder)
    pip = [sys.executable, "-m", "pip", "wheel", "-q", "--no-deps", "--no-build-isolation", "--no-index"]
    _require(
        [*pip, "-w", str(into), str(_find_only_file(folder, into, "*.tar.gz"))],
        f"{folder}: the wheel cannot be built from the sdist",
        into,
    )


def build_wheel(folder: str, into: Path, **environment: str) -> None:
    """Builds a package's wheel from the checkout, with environment variables for its build hook."""
    command = [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(into)]
    _require(command, f"{folder}: the wheel cannot be built", ROOT / folder, **environment)


def check_sdist_wheel(folder: str, built: Path) -> None:
    """Compares the files of the wheel built from the sdist with those of a wheel built from the checkout.

    Raises:
        ReleaseError: if they differ. The message names the files that only one of them has.
    """
    with tempfile.TemporaryDirectory() as place:
        build_wheel(folder, Path(place))
        direct = list_wheel_files(_find_only_file(folder, Path(place), "*.whl"))
    wheel = _find_only_file(folder, built, "*.whl")
    different = sorted(direct ^ list_wheel_files(wheel))
    if different:
        raise ReleaseError(
            f"{wheel.name} from the sdist and from the checkout differ in the files {different}."
        )


def list_wanted_files(folder: str) -> set[str]:
    """Returns the paths that a package's wheel should have.

    They are all files that git does not ignore, and for the edge the firmware.
    """
    package = PACKAGES[folder]
    paths = {path.removeprefix(f"{folder}/") for path in _list_files_known_to_git(f"{folder}/{package}")}
    if folder == "edge":
        paths |= {f"{package}/{path}" for path in _list_files_known_to_git(FIRMWARE)}
    return paths


def list_wheel_files(wheel: Path) -> set[str]:
    """Returns the paths in a wheel, without its metadata."""
    with zipfile.ZipFile(wheel) as archive:
        return {name for name in archive.namelist() if ".dist-info/" not in name}


def list_sdist_files(sdist: Path) -> set[str]:
    """Returns the paths in an sdist, relative to its top folder."""
    with tarfile.open(sdist) as archive:
        return {member.name.partition("/")[2] for member in archive if member.isfile()}


def check_files(folder: str, built: Path) -> None:
    """Compares the files of a wheel and an sdist with those that git tracks.

    Raises:
        ReleaseError: if they differ. The message names missing and superfluous files.
    """
    package, inside = PACKAGES[folder], list_wanted_files(folder)
    wheel, sdist = _find_only_file(folder, built, "*.whl"), _find_only_file(folder, built, "*.tar.gz")
    extra_files = {name for name in EXTRA_SDIST_FILES if (ROOT / folder / name).exists()} | {
        ".gitignore",
        "PKG-INFO",
    }
    packed = {
        path.removeprefix(f"{package}/") if path.startswith(f"{package}/{FIRMWARE}/") else path
        for path in inside
    }
    for archive, actual, expected in (
        (wheel, list_wheel_files(wheel), inside),
        (sdist, list_sdist_files(sdist) | {".gitignore"}, packed | extra_files),
    ):
        if actual != expected:
            missing, superfluous = sorted(expected - actual), sorted(actual - expected)
            raise ReleaseError(
                f"{archive.name}: missing files: {missing or 'none'}; unexpected files: "
                f"{superfluous or 'none'}."
            )


def check_metadata(built: Path) -> None:
    """Runs twine's checks that an index would accept the archives and render their descriptions."""
    files = sorted(map(str, built.iterdir()))
    command = [sys.executable, "-m", "twine", "--no-color", "check", "--strict", *files]
    _require(command, "twine reports an error in an archive", built)


def try_out(built: Path, of: str, names: list[str]) -> Iterator[str]:
    """Installs the wheels into empty environments and runs jobs with them.

    Yields one line per finished job.
    """
    with tempfile.TemporaryDirectory() as empty:
        for name in names:
            began = time.monotonic()
            place = Path(empty, name)
            environment = Environment(place, built, INSTALLS[name], of)
            yield environment.size(MAX_ENVIRONMENT_MB[name])
            yield environment.largest()
            yield from environment.basics()
            if name == "oak":
                yield from environment.camera_library()
            else:
                yield from environment.edge()
                yield from environment.library_page()
            if name == "studio":
                yield from environment.film()
            yield f"{INSTALLS[name]}: {time.monotonic() - began:.0f} s"
            shutil.rmtree(place)


def build_kernels(built: Path, of: str) -> Iterator[str]:
    """Compiles the kernels of all jobs for each processor level, and builds the wheel that contains them.

    It runs the jobs of the trial and the examples in an environment with the release's wheels. The levels are
    those that this processor supports. Code for a lower level also runs on it. On Linux, a second wheel
    contains the same kernels for aarch64.
    """
    with tempfile.TemporaryDirectory() as empty:
        environment = Environment(Path(empty, "kernels"), built, INSTALLS["studio"], of)
        folder = Path(empty, "compiled")
        for level in environment.processor_levels():
            began = time.monotonic()
            environment.compile_for(level, folder)
            count = len(list(folder.glob("*.kernel")))
            yield f"kernels for {level}: {count} files so far, {time.monotonic() - began:.0f} s"
        build_wheel("kernels", built, ENLIVEN_KERNELS=str(folder))
        if sys.platform == "linux" and platform.machine() != CROSS_MACHINE:
            began, arm = time.monotonic(), Path(empty, CROSS_MACHINE)
            environment.cross_compile(folder, arm)
            build_wheel("kernels", built, ENLIVEN_KERNELS=str(arm), ENLIVEN_KERNELS_MACHINE=CROSS_MACHINE)
            count = len(list(arm.glob("*.kernel")))
            yield f"kernels for {CROSS_MACHINE}: {count} files, {time.monotonic() - began:.0f} s"
        for wheel in sorted(built.glob("enliven_kernels-*-cp*.whl")):
            yield f"{wheel.name}: {wheel.stat().st_size / 1e6:.1f} MB"


class Environment:
    """A virtual environment with the wheels of a release, in a folder outside the checkout.

    Args:
        place: an empty folder for the environment, and for a home folder with no kernels in it.
        built: the folder of the wheels.
        requirement: the requirement to install.
        of: the version.
    """

    def __init__(self, place: Path, built: Path, requirement: str, of: str) -> None:
        self.place, self._of = place.resolve(), of
        self._bin = self.place / "venv" / ("Scripts" if os.name == "nt" else "bin")
        self._asked = requirement
        keep = {
            name: os.environ[name] for name in ("PATH", "DISPLAY", "LANG", "SYSTEMROOT") if name in os.environ
        }
        home = self.place / "home"
        home.mkdir(parents=True)
        (self.place / "work").mkdir()
        self._around = {**keep, "HOME": str(home), "NUMBA_CACHE_DIR": str(home / "numba")}
        subprocess.run([sys.executable, "-m", "venv", str(self.place / "venv")], check=True)
        self._bare = self._bytes()
        self._bare_code = self._bytes("*.pyc")
        # Other packages come from the index in pip's own settings. So this step gets the unchanged process
        # environment.
        pip = [str(self._bin / "python"), "-m", "pip", "install", "-q", "--disable-pip-version-check"]
        choice = ["-c", str(ROOT / "constraints.txt"), "--find-links", str(built), f"{requirement}=={of}"]
        subprocess.run([*pip, *choice], check=True)

    def processor_levels(self) -> list[str]:
        """Returns the processor levels for which this machine can compile and run, the best first."""
        ask = "from enliven.kernel_cache.target import processor_levels; print(*processor_levels())"
        return self._run(str(self._bin / "python"), "-c", ask).split()

    def compile_for(self, level: str, folder: Path) -> None:
        """Runs all jobs with kernels for a processor level, so that the folder contains these kernels."""
        self._around |= {"NUMBA_CPU_NAME": level, "NUMBA_CPU_FEATURES": "", "NUMBA_CACHE_DIR": str(folder)}
        shutil.rmtree(self.place / "work")
        (self.place / "work").mkdir()
        self._enliven(*EDGE)
        for _ in self.library_page():
            pass
        for name in EXAMPLES:
            self._run(str(self._bin / "python"), str(ROOT / "examples" / f"{name}.py"))
        self._enliven(*FILM)

    def cross_compile(self, folder: Path, into: Path) -> None:
        """Compiles the kernels of a folder for aarch64."""
        self._run(str(self._bin / "python"), str(CROSS_COMPILER), str(folder), str(into))

    def _bytes(self, pattern: str = "*") -> int:
        return sum(path.lstat().st_size for path in self.place.rglob(pattern) if path.is_file())

    def size(self, most: float) -> str:
        """Returns a line with the total size of the packages.

        Raises:
            ReleaseError: if they exceed ``most`` megabytes.
        """
        megabytes = (self._bytes() - self._bare) / 1e6
        code = (self._bytes("*.pyc") - self._bare_code) / 1e6
        line = f"{self._asked}: {megabytes:.0f} MB installed ({code:.0f} MB of byte code), limit {most} MB"
        if megabytes > most:
            raise ReleaseError(line)
        return line

    def largest(self) -> str:
        """Returns a line with the largest packages and their sizes in megabytes, with byte code."""
        ask = "import sysconfig; print(sysconfig.get_path('purelib'))"
        site = self._run(str(self._bin / "python"), "-c", ask)
        sizes = {
            each.metadata["Name"]: sum(
                Path(str(file.locate())).stat().st_size
                for file in each.files or ()
                if Path(str(file.locate())).is_file()
            )
            for each in distributions(path=[site])
        }
        largest = sorted(sizes.items(), key=lambda entry: -entry[1])[:LISTED_PACKAGES]
        listed = ", ".join(f"{name} {size / 1e6:.0f}" for name, size in largest)
        return f"{self._asked}: the largest packages, in MB: {listed}"

    def basics(self) -> Iterator[str]:
        """Prints the version, and runs the machine check."""
        if self._enliven("--version") != self._of:
            raise ReleaseError(f"enliven --version prints {self._enliven('--version')}, not {self._of}")
        yield self._report_step("enliven --version")
        self._enliven("doctor", codes=(0, 4))
        yield self._report_step("enliven doctor")

    def edge(self) -> Iterator[str]:
        """Possesses the chair with the shipped recording, and records the performance."""
        began = time.monotonic()
        self._enliven(*EDGE)
        compiled = len(list((self.place / "home" / "numba").glob("*.kernel")))
        yield self._report_step(
            f"enliven edge, {time.monotonic() - began:.0f} s, {compiled} kernels compiled"
        )
        if compiled > MAX_COMPILED_KERNELS:
            raise ReleaseError(
                f"the installed edge compiled {compiled} kernels that the release should contain"
            )

    def library_page(self) -> Iterator[str]:
        """Runs the code of docs/library.md."""
        work = self.place / "work"
        _require(
            [sys.executable, "-c", OWN_FILES, str(ROOT)],
            "the files for the document tests cannot be created",
            work,
        )
        self._run(str(self._bin / "python"), "-c", LIBRARY_PAGE, str(ROOT), str(self.place))
        yield self._report_step("the code of docs/library.md")

    def film(self) -> Iterator[str]:
        """Films the main job: an edge, and a viewer that shows it."""
        self._enliven(*FILM)
        films = list((self.place / "work" / FILM[-1]).glob("*.mp4"))
        if not films or not films[0].stat().st_size:
            raise ReleaseError(f"with {self._asked} installed, enliven {' '.join(FILM)} wrote no film")
        yield self._report_step(f"enliven run --film, {films[0].stat().st_size / 1e6:.1f} MB")

    def camera_library(self) -> Iterator[str]:
        """Imports the library for OAK cameras, and searches for a camera."""
        output = self._run(str(self._bin / "python"), "-c", "import depthai; print(depthai.__version__)")
        yield self._report_step(f"import depthai, version {output.splitlines()[-1]}")
        self._enliven("sensors", "--json")
        yield self._report_step("enliven sensors --json")

    def _report_step(self, name: str) -> str:
        return f"{self._asked}: {name}: done"

    def _enliven(self, *words: str, codes: tuple[int, ...] = (0,)) -> str:
        return self._run(str(self._bin / "enliven"), *words, codes=codes)

    def _run(self, *words: str, codes: tuple[int, ...] = (0,)) -> str:
        done = subprocess.run(
            words, cwd=self.place / "work", env=self._around, capture_output=True, text=True
        )
        if done.returncode not in codes:
            output = f"{done.stdout[-2000:]}{done.stderr[-3000:]}"
            raise ReleaseError(
                f"with {self._asked} installed, {' '.join(words[:2])} ended with the exit code "
                f"{done.returncode}:\n{output}"
            )
        return done.stdout.strip()


def _find_only_file(folder: str, built: Path, pattern: str) -> Path:
    (path,) = built.glob(f"{PACKAGES[folder]}-[0-9]{pattern}")
    return path


def _list_with_git(*words: str) -> str:
    return _require(["git", "-C", str(ROOT), *words], "git failed", ROOT).strip()


def _list_files_known_to_git(folder: str) -> list[str]:
    """Returns the paths, relative to the checkout, of a folder's files that are tracked or not ignored."""
    listed = _list_with_git("ls-files", "--cached", "--others", "--exclude-standard", folder).splitlines()
    return [path for path in listed if (ROOT / path).exists()]


def _require(command: list[str], failure: str, folder: Path, **environment: str) -> str:
    """Runs a command in a folder and returns its output. Raises ReleaseError if the command fails."""
    words = {**os.environ, **environment}
    done = subprocess.run(command, cwd=folder, env=words, capture_output=True, text=True)
    if done.returncode:
        raise ReleaseError(f"{failure}:\n{done.stdout[-2000:]}{done.stderr[-2000:]}")
    return done.stdout


def _print_lines(steps: Iterator[str]) -> list[str]:
    """Prints each step's line as soon as the step is done, and returns all lines."""
    lines = []
    for line in steps:
        print(line, flush=True)
        lines.append(line)
    return lines


def main() -> int:
    """Returns the exit code: 0 if the release is built, checked and tested."""
    parser = argparse.ArgumentParser(description="Build the release of this commit and test it.")
    parser.add_argument(
        "--no-trial", action="store_true", help="do not test the release in empty environments"
    )
    parser.add_argument(
        "--out", type=Path, default=ROOT / "out" / "release", help="output folder for the archives"
    )
    parser.add_argument("--only", choices=INSTALLS, help="test only this environment")
    options, of, lines = parser.parse_args(), version(), []
    try:
        check_commit(of)
        notes = section((ROOT / "CHANGELOG.md").read_text(encoding="utf-8"), of)
        archives = options.out / "archives"
        shutil.rmtree(options.out, ignore_errors=True)
        archives.mkdir(parents=True)
        for folder in PACKAGES:
            build(folder, archives)
            check_files(folder, archives)
            check_sdist_wheel(folder, archives)
        if not options.no_trial:
            lines += _print_lines(build_kernels(archives, of))
        check_metadata(archives)
        (options.out / "notes.md").write_text(notes, encoding="utf-8")
        count = len(list(archives.iterdir()))
        print(f"enliven {of}: {count} archives in {archives}; files and metadata checked", flush=True)
        if not options.no_trial:
            lines += _print_lines(try_out(archives, of, [options.only] if options.only else list(INSTALLS)))
            (options.out / "trial.txt").write_text("\n".join(lines) + "\n", encoding="utf-8")
    except ReleaseError as error:
        print(f"release: {error}", file=sys.stderr)
        return 1
    if is_development(of):
        print("this is a development build without a tag: do not publish it")
    return 0


if __name__ == "__main__":
    sys.exit(main())
