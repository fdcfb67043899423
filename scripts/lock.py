"""Write locks/run.txt and locks/dev.txt: constraints.txt with the SHA-256 of every wheel that may be installed.

    .venv/bin/python scripts/lock.py

The index is asked by pip's own client, as pip is configured here; only names, versions and hashes are written.
What pip offers for this holds one platform at a time (`pip lock`), so the list of a release's files is read by pip's
inner parts. constraints.txt pins pip, and with it these.
"""

from __future__ import annotations

import re
import sys
import tomllib
from collections.abc import Iterable, Iterator
from importlib.metadata import PackageNotFoundError, distribution, requires
from pathlib import Path

from packaging.markers import default_environment
from packaging.requirements import Requirement
from packaging.tags import Tag
from packaging.utils import InvalidWheelFilename, canonicalize_name, parse_wheel_filename

HOUSE = Path(__file__).parents[1]
PACKAGES = ("shared", "edge", "viewer")
EXTRAS = {"shared": ("test",), "edge": ("physics", "controls", "voice"), "viewer": ()}
"""What `make setup-dev` installs beyond what `make run` needs."""
BUILD = ("hatchling", "editables", "pip", "setuptools")
"""What installs the three packages themselves."""
PEERS = HOUSE / "tests" / "benchmarks" / "requirements.txt"
PYTHONS = (11, 12, 13, 14)
"""Minor versions of Python 3 that scripts/setup.sh takes."""
MACHINES = (
    {"sys_platform": "linux", "platform_system": "Linux", "os_name": "posix", "platform_machine": "x86_64"},
    {"sys_platform": "linux", "platform_system": "Linux", "os_name": "posix", "platform_machine": "aarch64"},
    {"sys_platform": "darwin", "platform_system": "Darwin", "os_name": "posix", "platform_machine": "arm64"},
    {"sys_platform": "darwin", "platform_system": "Darwin", "os_name": "posix", "platform_machine": "x86_64"},
    {"sys_platform": "win32", "platform_system": "Windows", "os_name": "nt", "platform_machine": "AMD64"},
)
PLATFORM = re.compile(r"any|manylinux.*_(x86_64|aarch64)|macosx_.*|win_amd64")
"""Platforms of wheels that run on one of MACHINES."""


def environments() -> Iterator[dict[str, str]]:
    """The values of markers for every Python on every machine."""
    for minor in PYTHONS:
        for machine in MACHINES:
            version = {"python_version": f"3.{minor}", "python_full_version": f"3.{minor}.2"}
            kind = {"implementation_name": "cpython", "platform_python_implementation": "CPython"}
            yield {**machine, **version, **kind}


def pins() -> dict[str, list[Requirement]]:
    """The lines of constraints.txt by canonical name."""
    found: dict[str, list[Requirement]] = {}
    for line in (HOUSE / "constraints.txt").read_text().splitlines():
        if line and not line.startswith("#"):
            pin = Requirement(line)
            found.setdefault(canonicalize_name(pin.name), []).append(pin)
    return found


def pinned(found: dict[str, list[Requirement]], name: str, where: dict[str, str]) -> Requirement | None:
    """The line that holds in this environment; None where there is none."""
    for pin in found.get(name, ()):
        if pin.marker is None or pin.marker.evaluate(where):
            return pin
    return None


def wanted(kind: str) -> list[str]:
    """What is asked for by name: kind is run, dev, or peers (those of the benchmarks)."""
    if kind == "peers":
        lines = (line.partition("#")[0].strip() for line in PEERS.read_text().splitlines())
        return [line for line in lines if line]
    asked = list(BUILD)
    for package in PACKAGES:
        project = tomllib.loads((HOUSE / package / "pyproject.toml").read_text())["project"]
        asked += project["dependencies"]
        for extra in EXTRAS[package] if kind == "dev" else ():
            asked += project["optional-dependencies"][extra]
    return [line for line in asked if not Requirement(line).name.startswith("enliven")]


def needed(asked: Iterable[str], where: dict[str, str]) -> set[str]:
    """Canonical names of all that is needed in an environment, by the metadata of what is installed here."""
    found: set[tuple[str, str]] = set()
    open_ = [Requirement(line) for line in asked]
    while open_:
        requirement = open_.pop()
        for extra in ("", *requirement.extras):
            at = (canonicalize_name(requirement.name), extra)
            if at in found:
                continue
            found.add(at)
            try:
                inner = [Requirement(line) for line in requires(at[0]) or ()]
            except PackageNotFoundError:
                continue
            open_ += [
                one for one in inner if one.marker is None or one.marker.evaluate({**where, "extra": extra})
            ]
    return {name for name, _ in found}


def absent(names: Iterable[str]) -> Iterator[str]:
    """Those that are not installed here, so that what they need in turn is not known."""
    for name in sorted(names):
        try:
            distribution(name)
        except PackageNotFoundError:
            yield name


def fits(tag: Tag) -> bool:
    """Whether a wheel's tag runs on one of PYTHONS and MACHINES."""
    mine = re.fullmatch(r"cp3(\d+)", tag.interpreter)
    if mine:
        minor, stable = int(mine[1]), tag.abi in ("abi3", "none")
        python = minor <= PYTHONS[-1] if stable else minor in PYTHONS and tag.abi == tag.interpreter
    else:
        python = tag.interpreter in ("py3", *(f"py3{minor}" for minor in PYTHONS)) and tag.abi == "none"
    return python and PLATFORM.fullmatch(tag.platform) is not None


def wheels(names: Iterable[str]) -> Iterator[tuple[str, str, str]]:
    """(name, version, SHA-256) of the fitting wheels of all releases of packages, as pip's index tells them."""
    from pip._internal.commands import create_command
    from pip._internal.index.collector import parse_links
    from pip._internal.models.link import Link

    command = create_command("install")
    options, _ = command.parse_args(["-q"])
    with command.main_context():
        finder = command._build_package_finder(options, command.get_default_session(options))
        for name in names:
            for place in finder.search_scope.get_index_urls_locations(name):
                page = finder._link_collector.fetch_response(Link(place))
                for link in parse_links(page) if page else ():
                    try:
                        _, version, _, tags = parse_wheel_filename(link.filename)
                    except InvalidWheelFilename:
                        continue
                    if any(map(fits, tags)) and (sha := (link._hashes or {}).get("sha256")):
                        yield name, str(version), sha


def main() -> None:
    found = pins()
    here = {key: str(value) for key, value in default_environment().items()}
    if lacking := list(absent(needed(wanted("dev"), here))):
        sys.exit(
            f"install these first, they may need more: pip install -c constraints.txt {' '.join(lacking)}"
        )
    hashes: dict[tuple[str, str], set[str]] = {}
    for name, version, sha in wheels(sorted(found)):
        hashes.setdefault((name, version), set()).add(sha)
    for kind in ("run", "dev"):
        names = set().union(*(needed(wanted(kind), where) for where in environments()))
        missing = sorted(names - set(found))
        if missing:
            sys.exit(f"constraints.txt has no line for {', '.join(missing)}")
        lines = ["# Written by scripts/lock.py: what make setup installs, and the SHA-256 of its wheels.\n"]
        for pin in (pin for name in sorted(names) for pin in found[name]):
            version = next(iter(pin.specifier)).version
            known = sorted(hashes.get((canonicalize_name(pin.name), version), ()))
            if not known:
                sys.exit(f"the index has no wheel of {pin.name} {version}")
            lines.append(" \\\n    ".join([str(pin), *(f"--hash=sha256:{sha}" for sha in known)]) + "\n")
        path = HOUSE / "locks" / f"{kind}.txt"
        path.parent.mkdir(exist_ok=True)
        path.write_text("".join(lines))
        print(f"{path.relative_to(HOUSE)}: {len(lines) - 1} packages")


if __name__ == "__main__":
    main()
