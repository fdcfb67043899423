"""Checks the installed packages: known vulnerabilities, licences, bundled libraries, and telemetry.

    make audit
    make audit ARGS=--offline

pip-audit and pip-licenses are installed in a separate environment, out/audit. Vulnerabilities come from the
package index. If a release could not be looked up, the check fails: its name is printed, and the exit code is
1. With --offline nothing is looked up, and this is printed.
"""

from __future__ import annotations

import argparse
import json
import mmap
import re
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parents[1]
TOOLS = ROOT / "out" / "audit"
AUDIT_TOOLS = ("pip-audit==2.10.1", "pip-licenses==5.5.5")
COPYLEFT = re.compile(r"\bA?GPL|(?<!Lesser )General Public License", re.IGNORECASE)
"""Pattern of copyleft licence names. It does not match the Lesser GPL."""
CHOSEN_LICENCES = {
    "hidapi": "BSD, of three that it offers",
    "atheris": "Apache-2.0, by its repository; its wheel names none",
}
"""Packages that offer several licences, one of them copyleft, and the licence that is used here."""


TELEMETRY_HOSTS = (
    b"events.data.microsoft.com",
    b"vortex.data.microsoft.com",
    b"applicationinsights",
    b"google-analytics.com",
    b"googletagmanager.com",
    b"app-measurement.com",
    b"play.googleapis.com/log",
    b"crashlytics",
    b"sentry.io",
    b"api.segment.io",
    b"posthog.com",
    b"mixpanel.com",
    b"amplitude.com",
    b"bugsnag.com",
    b"scarf.sh",
    b"datadoghq.com",
    b"newrelic.com",
)
"""Hosts that well-known telemetry libraries report to, as they appear in binaries and in source text."""
TELEMETRY_OFF = {("onnxruntime", "events.data.microsoft.com"): "off by enliven_edge.onnx_runtime"}
"""How the telemetry is disabled, by the top folder of a package and the host named in it."""


def main() -> None:
    """Prints the checks and the problems found. The exit code is 1 if there is any problem."""
    parser = argparse.ArgumentParser(description="Check the installed packages.")
    parser.add_argument(
        "--offline",
        action="store_true",
        help="skip the look-up of vulnerabilities, for computers without a network",
    )
    arguments = parser.parse_args()
    problems = [] if arguments.offline else vulnerabilities()
    if arguments.offline:
        print(f"vulnerabilities: not checked, because of --offline ({len(read_pins())} releases)")
    problems += licences()
    for name in sorted(set(list_bundled_libraries(find_site_packages())) - list_documented_libraries()):
        problems.append(f"a wheel bundles {name}, which docs/licences.md does not list")
    problems += telemetry(find_site_packages())
    print(*problems or ["audit: no problems"], sep="\n")
    sys.exit(bool(problems))


def tool(name: str) -> str:
    """Returns the path of one of the tools, after installing it if it is missing."""
    scripts = TOOLS / ("Scripts" if sys.platform == "win32" else "bin")
    if not (scripts / name).exists():
        subprocess.run([sys.executable, "-m", "venv", TOOLS], check=True)
        subprocess.run([scripts / "python", "-m", "pip", "install", "-q", *AUDIT_TOOLS], check=True)
    return str(scripts / name)


def read_pins() -> list[str]:
    """Returns the requirements of constraints.txt without comments and markers."""
    lines = (ROOT / "constraints.txt").read_text().splitlines()
    return [line.partition(";")[0].strip() for line in lines if line and not line.startswith("#")]


def group_requirements(lines: list[str]) -> list[list[str]]:
    """Returns the requirements in groups, because pip-audit accepts only one release of a package at a
    time.
    """
    groups: list[dict[str, str]] = []
    for line in lines:
        name = line.partition("==")[0]
        free = next((group for group in groups if name not in group), None)
        if free is None:
            groups.append(free := {})
        free[name] = line
    return [list(group.values()) for group in groups]


def vulnerabilities() -> list[str]:
    """Returns one sentence for each known vulnerability of a pinned release.

    Adds one sentence for each release that was not looked up.
    """
    releases: list[dict] = []
    not_asked: list[str] = []
    reason = "the package index has no vulnerability data"
    for pins in group_requirements(read_pins()):
        with tempfile.TemporaryDirectory() as folder:
            (path := Path(folder) / "pins.txt").write_text("\n".join(pins) + "\n")
            options = ["-r", path, "--no-deps", "--disable-pip", "-f", "json", "--progress-spinner", "off"]
            try:
                process = subprocess.run([tool("pip-audit"), *options], capture_output=True, text=True)
                releases += json.loads(process.stdout)["dependencies"]
            except (subprocess.CalledProcessError, OSError) as error:
                not_asked, reason = not_asked + pins, f"pip-audit cannot be installed or run ({error})"
            except (json.JSONDecodeError, KeyError):
                last = process.stderr.strip().splitlines()[-1:] or ["no error message"]
                not_asked, reason = not_asked + pins, f"pip-audit failed: {last[0][:200]}"
    checked = [release for release in releases if "skip_reason" not in release]
    print(f"vulnerabilities: {len(checked)} of {len(releases) + len(not_asked)} releases were checked")
    return [*find_flaws(checked), *describe_unchecked(releases, not_asked, reason)]


def find_flaws(releases: list[dict]) -> list[str]:
    """Returns one sentence for each vulnerability of the releases that were looked up."""
    return [
        f"{release['name']} {release['version']}: {flaw['id']}, "
        f"fixed in {', '.join(flaw['fix_versions']) or 'none'}"
        for release in releases
        for flaw in release["vulns"]
    ]


def describe_unchecked(releases: list[dict], not_asked: list[str], reason: str) -> list[str]:
    """Returns one sentence that names the releases that were not looked up, in a list.

    The list is empty if all were looked up.

    Args:
        releases: pip-audit's answers. A skipped release has a ``skip_reason``.
        not_asked: requirements for which pip-audit gave no answer.
        reason: the reason, if the answers do not give one.
    """
    skipped = [release for release in releases if "skip_reason" in release]
    names = sorted([release["name"] for release in skipped] + [pin.partition("==")[0] for pin in not_asked])
    if not names:
        return []
    reasons = {release["skip_reason"] for release in skipped}
    why = reason if not_asked or len(reasons) != 1 else str(reasons.pop())[:200]
    return [
        f"vulnerabilities of {len(names)} releases were not checked ({why}): {', '.join(names)}. "
        "Use an index with vulnerability data, such as PyPI, or skip the check with --offline."
    ]


def telemetry(packages: Path) -> list[str]:
    """Returns one sentence for each telemetry host in an installed package.

    Hosts with disabled telemetry are left out.
    """
    hosts = sorted(set(find_telemetry_hosts(packages)))
    for package, host in hosts:
        if (package, host) in TELEMETRY_OFF:
            print(f"telemetry: {package} contains the host {host}: {TELEMETRY_OFF[package, host]}")
    return [
        (
            f"{package} contains the telemetry host {host}: turn the telemetry off, and describe how in "
            "scripts/audit.py"
        )
        for package, host in hosts
        if (package, host) not in TELEMETRY_OFF
    ]


def find_telemetry_hosts(packages: Path) -> Iterator[tuple[str, str]]:
    """Yields the top folder of a package and a telemetry host.

    It yields one pair for each file that contains the host's name.
    """
    for path in packages.rglob("*"):
        if path.suffix == ".pyc" or not path.is_file() or not path.stat().st_size:
            continue
        with path.open("rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as content:
            for host in TELEMETRY_HOSTS:
                if content.find(host) >= 0:
                    yield path.relative_to(packages).parts[0], host.decode()


def licences() -> list[str]:
    """Prints the licences. Returns one sentence for each installed package with an unacceptable licence."""
    command = [tool("pip-licenses"), "--python", sys.executable, "--format", "json", "--with-system"]
    packages = json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)
    kinds = sorted({package["License"] for package in packages})
    print(f"licences: {len(packages)} packages with {len(kinds)} licence names: {'; '.join(kinds)}")
    return find_licence_problems(packages)


def find_licence_problems(packages: list[dict[str, str]]) -> list[str]:
    """Returns one sentence for each package with an unknown licence, or with copyleft and no other choice."""
    return [
        f"{package['Name']} {package['Version']} has the licence {package['License']!r}"
        for package in packages
        if package["Name"] not in CHOSEN_LICENCES
        and (package["License"] == "UNKNOWN" or COPYLEFT.search(package["License"]))
    ]


def find_site_packages() -> Path:
    """Returns the folder of this Python's installed packages."""
    import numpy

    return Path(numpy.__file__).parents[1]


def list_bundled_libraries(packages: Path) -> Iterator[str]:
    """Yields the names of the libraries that wheels bundle, without "lib", hash and version."""
    for folder in (*packages.glob("*.libs"), *packages.glob("*/.dylibs")):
        for path in folder.iterdir():
            stem = path.name.partition(".")[0].removeprefix("lib")
            yield re.sub(r"-\d+$", "", re.sub(r"(-[0-9a-f]{8,})+$", "", stem))


def list_documented_libraries() -> set[str]:
    """Returns the libraries named in backquotes in docs/licences.md, without "lib"."""
    text = (ROOT / "docs" / "licences.md").read_text()
    return {name.removeprefix("lib") for name in re.findall(r"`([\w+-]+)`", text)}


if __name__ == "__main__":
    main()
