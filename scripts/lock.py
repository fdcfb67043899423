"""Writes locks/run.txt and locks/dev.txt: constraints.txt with the SHA-256 of each wheel.

    .venv/bin/python scripts/lock.py                          # after constraints.txt has changed
    .venv/bin/python scripts/lock.py lines dev aarch64 3.11 # prints a lock for another machine

pip's own client queries the package index, with this machine's pip configuration. The lock files contain
names, versions and hashes, but no addresses. `pip lock` supports only one platform at a time. So pip's
internal modules list the files of a release. constraints.txt pins pip's version, so these modules do not
change.
"""

from __future__ import annotations

import re
import sys
import tomllib
from collections.abc import Iterable, Iterator
from contextlib import suppress
from importlib.metadata import PackageNotFoundError, distribution, requires
from pathlib import Path

from packaging.markers import default_environment
from packaging.requirements import Requirement
from packaging.tags import Tag
from packaging.utils import InvalidWheelFilename, canonicalize_name, parse_wheel_filename

Wheels = dict[tuple[str, str], dict[str, frozenset[Tag]]]
"""The tags of each wheel by the wheel's SHA-256, for each (name, version)."""
ROOT = Path(__file__).parents[1]
PACKAGES = ("shared", "edge", "viewer", "synthesis")
RUN_EXTRAS = {"shared": ("compressed",), "edge": ("bags", "outputs")}
"""Extras that `make setup` installs, by package. They decode files that a user may open."""
DEV_EXTRAS = {
    "shared": ("batch", "test", "usd", "health"),
    "viewer": ("web", "discovery"),
    "edge": ("physics", "controls", "voice", "oak", "realsense", "libcamera", "discovery", "foxglove"),
}
"""Extras that `make setup-dev` installs in addition, by package."""
BUILD = ("hatchling", "editables", "pip", "setuptools")
"""Packages needed to install the project's own packages."""
PEERS = tuple(ROOT / "tests" / room / "requirements.txt" for room in ("benchmarks", "fuzz"))
"""Requirements of `make bench` and `make fuzz`, which are installed only by these commands."""
PYTHONS = (11, 12, 13, 14)
"""Minor versions of Python 3 that scripts/setup.sh accepts."""
MACHINES = (
    {"sys_platform": "linux", "platform_system": "Linux", "os_name": "posix", "platform_machine": "x86_64"},
    {"sys_platform": "linux", "platform_system": "Linux", "os_name": "posix", "platform_machine": "aarch64"},
    {"sys_platform": "darwin", "platform_system": "Darwin", "os_name": "posix", "platform_machine": "arm64"},
    {"sys_platform": "win32", "platform_system": "Windows", "os_name": "nt", "platform_machine": "AMD64"},
)
PLATFORMS = {
    "x86_64": re.compile(r"any|manylinux.*_x86_64"),
    "aarch64": re.compile(r"any|manylinux.*_aarch64"),
    "arm64": re.compile(r"any|macosx_.*_(arm64|universal2)"),
    "AMD64": re.compile(r"any|win_amd64"),
}
"""Wheel platforms that run on each of MACHINES. Numba has no wheels for Intel Macs."""


def list_environments() -> Iterator[dict[str, str]]:
    """Yields the marker values for every Python version on every machine."""
    for minor in PYTHONS:
        for machine in MACHINES:
            version = {"python_version": f"3.{minor}", "python_full_version": f"3.{minor}.2"}
            kind = {"implementation_name": "cpython", "platform_python_implementation": "CPython"}
            yield {**machine, **version, **kind}


def read_pins() -> dict[str, list[Requirement]]:
    """Returns the lines of constraints.txt by canonical name."""
    requirements: dict[str, list[Requirement]] = {}
    for line in (ROOT / "constraints.txt").read_text().splitlines():
        if line and not line.startswith("#"):
            pin = Requirement(line)
            requirements.setdefault(canonicalize_name(pin.name), []).append(pin)
    return requirements


def parse_pin(
    requirements: dict[str, list[Requirement]], name: str, environment: dict[str, str]
) -> Requirement | None:
    """Returns the requirement that applies in this environment, or None."""
    for pin in requirements.get(name, ()):
        if pin.marker is None or pin.marker.evaluate(environment):
            return pin
    return None


def list_requested_packages(kind: str) -> list[str]:
    """Returns the packages requested by name.

    ``kind`` is run, dev, or peers (the packages that only benchmarks and fuzzing use).
    """
    if kind == "peers":
        texts = (line for path in PEERS for line in path.read_text().splitlines())
        lines = (line.partition("#")[0].strip() for line in texts)
        return [line for line in lines if line]
    requested = list(BUILD)
    for package in PACKAGES:
        pyproject = tomllib.loads((ROOT / package / "pyproject.toml").read_text())
        hooks = pyproject["tool"]["hatch"].get("metadata", {}).get("hooks", {})
        requested += (hooks.get("custom") or pyproject["project"])["dependencies"]
        extras = [*RUN_EXTRAS.get(package, ())]
        extras += DEV_EXTRAS.get(package, ()) if kind == "dev" else ()
        for extra in extras:
            requested += pyproject["project"]["optional-dependencies"][extra]
    return [line for line in requested if not Requirement(line).name.startswith("enliven")]


def list_required_packages(requested: Iterable[str], environment: dict[str, str]) -> set[str]:
    """Returns the canonical names of all packages that an environment requires.

    They come from the metadata of the packages installed here.
    """
    packages: set[tuple[str, str]] = set()
    queue = [(Requirement(line), "") for line in requested]
    while queue:
        requirement, extra = queue.pop()
        if requirement.marker is not None and not requirement.marker.evaluate(
            {**environment, "extra": extra}
        ):
            continue
        for asked_for in ("", *requirement.extras):
            at = (canonicalize_name(requirement.name), asked_for)
            if at not in packages:
                packages.add(at)
                with suppress(PackageNotFoundError):
                    queue += [(Requirement(line), asked_for) for line in requires(at[0]) or ()]
    return {name for name, _ in packages}


def list_missing_packages(names: Iterable[str]) -> Iterator[str]:
    """Yields the packages that are not installed here. Their own requirements are therefore unknown."""
    for name in sorted(names):
        try:
            distribution(name)
        except PackageNotFoundError:
            yield name


def fits(tag: Tag, where: dict[str, str]) -> bool:
    """Returns True if a wheel with this tag runs in an environment."""
    minor = int(where["python_version"].removeprefix("3."))
    made_for = re.fullmatch(r"cp3(\d+)", tag.interpreter)
    if made_for is None:
        python = tag.interpreter in ("py3", f"py3{minor}") and tag.abi == "none"
    elif tag.abi in ("abi3", "none"):
        python = int(made_for[1]) <= minor
    else:
        python = tag.interpreter == tag.abi == f"cp3{minor}"
    return python and PLATFORMS[where["platform_machine"]].fullmatch(tag.platform) is not None


def list_wheels(names: Iterable[str]) -> Wheels:
    """Returns the wheels of all releases of packages, as listed by the index that pip uses."""
    from pip._internal.commands import create_command
    from pip._internal.commands.install import InstallCommand
    from pip._internal.index.collector import parse_links
    from pip._internal.models.link import Link

    offered: Wheels = {}
    command = create_command("install")
    options, _ = command.parse_args(["-q"])
    with command.main_context():
        assert isinstance(command, InstallCommand)
        finder = command._build_package_finder(options, command.get_default_session(options))
        for name in names:
            for place in finder.search_scope.get_index_urls_locations(name):
                page = finder._link_collector.fetch_response(Link(place))
                for link in parse_links(page) if page else ():
                    try:
                        _, version, _, tags = parse_wheel_filename(link.filename)
                    except InvalidWheelFilename:
                        continue
                    if sha := (link._hashes or {}).get("sha256"):
                        offered.setdefault((name, str(version)), {})[sha] = tags
    return offered


def lock_lines(kind: str, requirements: dict[str, list[Requirement]], offered: Wheels) -> list[str]:
    """Returns the lines of a lock file, sorted by name. Prints the packages that have no wheel."""
    hashes: dict[tuple[str, str], set[str]] = {}
    lacking: dict[str, list[str]] = {}
    for where in list_environments():
        for name in list_required_packages(list_requested_packages(kind), where):
            pin = parse_pin(requirements, name, where)
            if pin is None:
                sys.exit(f"constraints.txt has no line for {name} with Python {where['python_version']}")
            key = name, next(iter(pin.specifier)).version
            fitting = {
                sha for sha, tags in offered.get(key, {}).items() if any(fits(tag, where) for tag in tags)
            }
            hashes.setdefault((name, str(pin)), set()).update(fitting)
            if not fitting:
                place = f"{where['platform_machine']} {where['python_version']}"
                lacking.setdefault(" ".join(key), []).append(place)
    for release, places in lacking.items():
        print(f"{release} has no wheel for {', '.join(places)}")
    return [
        " \\\n    ".join([line, *(f"--hash=sha256:{sha}" for sha in sorted(shas))])
        for (_, line), shas in sorted(hashes.items())
        if shas
    ]


def make_lines_for(kind: str, machine: str, python: str) -> Iterator[str]:
    """Yields a lock file's lines for another machine.

    They have no markers, because pip would evaluate the markers for this machine.
    """
    (where,) = (
        at
        for at in list_environments()
        if (at["platform_machine"], at["python_version"]) == (machine, python)
    )
    for line in (ROOT / "locks" / f"{kind}.txt").read_text().replace("\\\n", "").splitlines():
        text, *hashes = line.split(" --hash=")
        if not line.startswith("#"):
            pin = Requirement(text)
            if pin.marker is None or pin.marker.evaluate(where):
                yield " --hash=".join([f"{pin.name}{pin.specifier}", *(h.strip() for h in hashes)])


def main() -> None:
    """Writes the lock files. Exits with an error if a required package is not installed."""
    requirements = read_pins()
    environment = {key: str(value) for key, value in default_environment().items()}
    if unknown := list(
        list_missing_packages(list_required_packages(list_requested_packages("dev"), environment))
    ):
        sys.exit(
            f"packages are missing. Install them first: pip install -c constraints.txt {' '.join(unknown)}"
        )
    offered = list_wheels(sorted(requirements))
    for kind in ("run", "dev"):
        lines = lock_lines(kind, requirements, offered)
        path = ROOT / "locks" / f"{kind}.txt"
        path.parent.mkdir(exist_ok=True)
        head = "# Written by scripts/lock.py: what `make setup` installs, with the SHA-256 of each wheel."
        path.write_text("\n".join([head, *lines]) + "\n")
        print(f"{path.relative_to(ROOT)}: {len(lines)} releases")


if __name__ == "__main__":
    if sys.argv[1:2] == ["lines"]:
        print(*make_lines_for(*sys.argv[2:5]), sep="\n")
    else:
        main()
