"""Tests that constraints.txt and locks/ list every dependency for every Python and machine that setup.sh
supports.
"""

import importlib.util
import re
from importlib.metadata import version
from pathlib import Path

import pytest
from packaging.markers import default_environment
from packaging.requirements import Requirement
from packaging.tags import parse_tag

HOUSE = Path(__file__).parents[2]


def script(name: str):
    """Imports one of the repository's scripts as a module."""
    spec = importlib.util.spec_from_file_location(name, HOUSE / "scripts" / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


lock, audit = script("lock"), script("audit")
EVERYWHERE = {f"{at['platform_machine']} {at['python_version']}": at for at in lock.list_environments()}
WITHOUT_WHEEL = {"aarch64": {"3.12", "3.13", "3.14"}}
"""Python versions for which moderngl has no wheel, by machine type. setup.sh refuses them."""


def lock_lines(kind: str) -> list[str]:
    """Returns a lock file's requirements with their hashes."""
    text = (HOUSE / "locks" / f"{kind}.txt").read_text().replace("\\\n", " ")
    return [line for line in text.splitlines() if not line.startswith("#")]


def locked(kind: str, where: dict[str, str]) -> dict[str, str]:
    """Returns name and version of the packages that a lock file installs in an environment."""
    requirements = [Requirement(line.partition("--hash")[0]) for line in lock_lines(kind)]
    fitting = [pin for pin in requirements if pin.marker is None or pin.marker.evaluate(where)]
    assert len({pin.name for pin in fitting}) == len(fitting), "one release of a package, not two"
    return {lock.canonicalize_name(pin.name): next(iter(pin.specifier)).version for pin in fitting}


@pytest.mark.parametrize("where", EVERYWHERE.values(), ids=EVERYWHERE)
def test_every_dependency_is_pinned(where) -> None:
    pins = lock.read_pins()
    asked = [*lock.list_requested_packages("dev"), *lock.list_requested_packages("peers")]
    assert [
        name
        for name in sorted(lock.list_required_packages(asked, where))
        if not lock.parse_pin(pins, name, where)
    ] == []
    for requirement in map(Requirement, asked):
        if requirement.marker is None or requirement.marker.evaluate(where):
            pin = lock.parse_pin(pins, lock.canonicalize_name(requirement.name), where)
            assert next(iter(pin.specifier)).version in requirement.specifier


@pytest.mark.parametrize("kind", ["run", "dev"])
@pytest.mark.parametrize("where", EVERYWHERE.values(), ids=EVERYWHERE)
def test_lock_file_installs_exactly_the_needed_packages(kind, where) -> None:
    pins, names = lock.read_pins(), lock.list_required_packages(lock.list_requested_packages(kind), where)
    if where["python_version"] in WITHOUT_WHEEL.get(where["platform_machine"], ()):
        names.discard("pocketsphinx")
        assert set(locked(kind, where)) - {"pocketsphinx"} == names
    else:
        wanted = {name: next(iter(lock.parse_pin(pins, name, where).specifier)).version for name in names}
        assert locked(kind, where) == wanted


def test_installed_versions_match_the_pins() -> None:
    here = {key: str(value) for key, value in default_environment().items()}
    pins = lock.read_pins()
    for name in lock.list_required_packages(lock.list_requested_packages("dev"), here):
        assert version(name) in lock.parse_pin(pins, name, here).specifier, name
    for name in lock.list_required_packages(lock.list_requested_packages("peers"), here) - set(
        lock.list_missing_packages(pins)
    ):
        assert version(name) in lock.parse_pin(pins, name, here).specifier, name


@pytest.mark.parametrize("kind", ["run", "dev"])
def test_locks_have_hashes_and_no_address(kind) -> None:
    for line in lock_lines(kind):
        hashes = line.split("--hash=")[1:]
        assert hashes and all(re.fullmatch(r"sha256:[0-9a-f]{64}\s*", text) for text in hashes), line
        assert "://" not in line and "@" not in line


@pytest.mark.parametrize(
    ("tag", "places"),
    [
        ("py3-none-any", 16),
        ("cp311-cp311-manylinux2014_x86_64", 1),
        ("cp312-abi3-manylinux_2_28_aarch64", 3),
        ("cp39-abi3-win_amd64", 4),
        ("py3-none-macosx_12_0_arm64", 4),
        ("cp313-cp313t-manylinux_2_28_x86_64", 0),
        ("cp310-cp310-manylinux_2_28_x86_64", 0),
        ("cp311-cp311-musllinux_1_2_x86_64", 0),
        ("cp311-cp311-macosx_10_9_x86_64", 0),
    ],
)
def test_wheel_tag_fits_the_expected_environments(tag, places) -> None:
    (tag_parsed,) = parse_tag(tag)
    assert sum(lock.fits(tag_parsed, where) for where in EVERYWHERE.values()) == places


def test_the_page_on_licences_names_every_library_that_a_wheel_bundles() -> None:
    bundled = set(audit.list_bundled_libraries(audit.find_site_packages()))
    assert len(bundled) > 10 and bundled - audit.list_documented_libraries() == set()


@pytest.mark.parametrize(
    ("file", "name"),
    [
        ("libx264-d6533a8d.so.165", "x264"),
        ("libusb-1-150b88da.0.so.0.1.0", "usb"),
        ("libgfortran-040039e1-0352e75f.so.5.0.0", "gfortran"),
        ("libopencore-amrnb-d72c52e2.so.0.0.5", "opencore-amrnb"),
        ("libavcodec.62.28.102.dylib", "avcodec"),
        ("avcodec-62-5e6b81c2aa.dll", "avcodec"),
    ],
)
def test_a_bundled_library_is_known_by_its_name(file, name, tmp_path) -> None:
    (tmp_path / "some.libs").mkdir()
    (tmp_path / "some.libs" / file).touch()
    assert list(audit.list_bundled_libraries(tmp_path)) == [name]


@pytest.mark.parametrize(
    ("licence", "objected"),
    [
        ("MIT", False),
        ("LGPL-3.0", False),
        ("GNU Lesser General Public License v3 (LGPLv3)", False),
        ("GPL-2.0-or-later", True),
        ("GNU General Public License v3 (GPLv3)", True),
        ("AGPL-3.0", True),
        ("UNKNOWN", True),
    ],
)
def test_copyleft_package_is_reported(licence, objected) -> None:
    assert (
        bool(audit.find_licence_problems([{"Name": "some", "Version": "1", "License": licence}])) is objected
    )


def test_a_release_that_could_not_be_looked_up_does_not_pass() -> None:
    audited = [
        {"name": "known", "version": "1", "vulns": []},
        {"name": "private", "version": "2", "skip_reason": "Dependency not found on PyPI"},
    ]
    (sentence,) = audit.describe_unchecked(audited, ["unasked==3"], "pip-audit failed: no network")
    assert "2 releases were not checked" in sentence and "private, unasked" in sentence
    assert "known" not in sentence and "no network" in sentence and "--offline" in sentence
    assert audit.describe_unchecked(audited[:1], [], "") == []
    flaw = {"id": "PYSEC-1", "fix_versions": ["2"]}
    assert audit.find_flaws([audited[0], {"name": "b", "version": "1", "vulns": [flaw]}]) == [
        "b 1: PYSEC-1, fixed in 2"
    ]


def test_pip_audit_without_an_answer_does_not_pass(monkeypatch, capsys) -> None:
    monkeypatch.setattr(audit, "tool", lambda name: "false")
    (sentence,) = audit.vulnerabilities()
    count = len(audit.read_pins())
    assert f"{count} releases were not checked (pip-audit failed" in sentence and "numpy" in sentence
    assert f"0 of {count} releases" in capsys.readouterr().out


def test_audit_without_a_network_reports_its_omissions(monkeypatch, capsys) -> None:
    for part in ("licences", "list_bundled_libraries", "telemetry"):
        monkeypatch.setattr(audit, part, lambda *_: [])
    monkeypatch.setattr(audit, "vulnerabilities", lambda: ["numpy was not checked"])
    for arguments, code in (([], 1), (["--offline"], 0)):
        monkeypatch.setattr("sys.argv", ["audit.py", *arguments])
        with pytest.raises(SystemExit) as ended:
            audit.main()
        output = capsys.readouterr().out
        assert ended.value.code == code and ("not checked, because of --offline" in output) == (code == 0)


def test_telemetry_host_in_a_package_is_reported(tmp_path, capsys) -> None:
    for package, content in (
        ("chatty", b"\0https://o1.ingest.sentry.io/api\0"),
        ("onnxruntime", b"\0https://mobile.events.data.microsoft.com/\0"),
        ("quiet", b"https://example.org"),
    ):
        (tmp_path / package).mkdir()
        (tmp_path / package / "library.so").write_bytes(b"\x7fELF" + content)
    (sentence,) = audit.telemetry(tmp_path)
    assert sentence.startswith("chatty contains the telemetry host sentry.io")
    assert "onnxruntime contains the host events.data.microsoft.com: off by" in capsys.readouterr().out
