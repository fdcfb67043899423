"""What is known against the packages that are pinned: their vulnerabilities, and their licences.

    make audit

pip-audit and pip-licenses live in an environment of their own, out/audit. Vulnerabilities come from the
package index; an index that has no such data is told apart from one that knows of none.
"""

from __future__ import annotations

import json
import re
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

HOUSE = Path(__file__).parents[1]
TOOLS = HOUSE / "out" / "audit"
WANTED = ("pip-audit==2.10.1", "pip-licenses==5.5.5")
COPYLEFT = re.compile(r"\bA?GPL|(?<!Lesser )General Public License", re.IGNORECASE)
"""In a licence's name; the Lesser one is none of these."""
CHOSEN = {"hidapi": "BSD, of three that it offers"}
"""Packages whose copyleft licence is one of several, and which of them is taken here."""


def main() -> None:
    bad = vulnerabilities() + licences()
    for name in sorted(set(bundled(site_packages())) - documented()):
        bad.append(f"{name} is bundled by a wheel, and docs/licences.md does not name it")
    print(*bad or ["audit: nothing to object to"], sep="\n")
    sys.exit(bool(bad))


def tool(name: str) -> str:
    """The path of one of the tools, installed first where it is not there."""
    scripts = TOOLS / ("Scripts" if sys.platform == "win32" else "bin")
    if not (scripts / name).exists():
        subprocess.run([sys.executable, "-m", "venv", TOOLS], check=True)
        subprocess.run([scripts / "python", "-m", "pip", "install", "-q", *WANTED], check=True)
    return str(scripts / name)


def vulnerabilities() -> list[str]:
    """A sentence for each known vulnerability of what constraints.txt pins."""
    lines = (HOUSE / "constraints.txt").read_text().splitlines()
    # pip-audit takes one release of a package at a time, and none that a marker leaves out.
    rounds: list[dict[str, str]] = []
    for line in (line.partition(";")[0].strip() for line in lines if line and not line.startswith("#")):
        name = line.partition("==")[0]
        free = next((one for one in rounds if name not in one), None)
        if free is None:
            rounds.append(free := {})
        free[name] = line
    found: list[dict] = []
    for pins in rounds:
        with tempfile.TemporaryDirectory() as folder:
            (path := Path(folder) / "pins.txt").write_text("\n".join(pins.values()) + "\n")
            command = [tool("pip-audit"), "-r", path, "--no-deps", "--disable-pip", "-f", "json"]
            done = subprocess.run([*command, "--progress-spinner", "off"], capture_output=True, text=True)
        try:
            found += json.loads(done.stdout)["dependencies"]
        except (json.JSONDecodeError, KeyError):
            return [f"pip-audit failed: {done.stderr.strip().splitlines()[-1:]}"]
    known = [one for one in found if "skip_reason" not in one]
    print(f"vulnerabilities: {len(known)} of {len(found)} releases could be looked up")
    if not known:
        print("vulnerabilities: the package index here has no such data, so nothing is known of any")
    return [
        f"{one['name']} {one['version']}: {flaw['id']}, mended in {', '.join(flaw['fix_versions']) or 'none'}"
        for one in known
        for flaw in one["vulns"]
    ]


def licences() -> list[str]:
    """A sentence for each installed package whose licence is objected to; the licences are printed."""
    command = [tool("pip-licenses"), "--python", sys.executable, "--format", "json", "--with-system"]
    found = json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)
    kinds = sorted({one["License"] for one in found})
    print(f"licences: {len(found)} packages under {len(kinds)} names: {'; '.join(kinds)}")
    return objections(found)


def objections(found: list[dict[str, str]]) -> list[str]:
    """A sentence for each package whose licence is not known, or is copyleft without a choice."""
    return [
        f"{one['Name']} {one['Version']} has the licence {one['License']!r}"
        for one in found
        if one["License"] == "UNKNOWN" or (COPYLEFT.search(one["License"]) and one["Name"] not in CHOSEN)
    ]


def site_packages() -> Path:
    """Where the packages of this Python are."""
    import numpy

    return Path(numpy.__file__).parents[1]


def bundled(packages: Path) -> Iterator[str]:
    """Names of the libraries in the folders that wheels bring along, without lib, hash and version."""
    for folder in (*packages.glob("*.libs"), *packages.glob("*/.dylibs")):
        for path in folder.iterdir():
            stem = path.name.partition(".")[0].removeprefix("lib")
            yield re.sub(r"-\d+$", "", re.sub(r"(-[0-9a-f]{8,})+$", "", stem))


def documented() -> set[str]:
    """The libraries that docs/licences.md names, each in backquotes, without lib."""
    text = (HOUSE / "docs" / "licences.md").read_text()
    return {name.removeprefix("lib") for name in re.findall(r"`([\w+-]+)`", text)}


if __name__ == "__main__":
    main()
