"""Tests of installing a kiosk into a system in a folder: its files, its systemd units, and their removal."""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

import pytest
import typer

from enliven.commands.install_kiosk import install_kiosk
from enliven.errors import InputError
from enliven.installation.install_plan import create_plan
from enliven.installation.installer import Installer
from enliven.installation.requirements import find_lacks
from enliven.kiosk.profile import load_profile

PROFILE = """
name = "foyer"
[edges.edge]
[edges.stairs]
port = 5600
[characters.horse]
mesh = "meshes/horse.obj"
[care]
restart_at = "04:00"
recordings = "visits"
[souvenir]
kind = "photo"
host = "0.0.0.0"
"""
UNITS = ("edge@", "kiosk", "health", "souvenirs")
"""Names of the units that start at boot, without their prefix."""
needs_systemd = pytest.mark.skipif(
    shutil.which("systemd-analyze") is None or os.geteuid() != 0, reason="needs systemd's tools, and root"
)


@pytest.fixture
def profile(tmp_path: Path) -> Path:
    """Returns a profile in its own folder, with a mesh and a secret."""
    folder = tmp_path / "kiosk"
    (folder / "meshes").mkdir(parents=True)
    (folder / "meshes" / "horse.obj").write_text("v 0 0 0\n")
    (folder / "meshes" / "horse.mtl").write_text("newmtl fur\n")
    (folder / "password").write_text("secret\n")
    (folder / "password").chmod(0o600)
    (folder / ".hidden").write_text("left out\n")
    path = folder / "foyer.toml"
    path.write_text(PROFILE)
    return path


@pytest.fixture
def root(tmp_path: Path) -> Path:
    """Returns a system with the programs that a kiosk needs, and with a udev rule of its own."""
    root = tmp_path / "root"
    for program in ("cage", "seatd"):
        path = root / "usr" / "bin" / program
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("#!/bin/sh\n")
        path.chmod(0o755)
    (root / "etc" / "udev" / "rules.d").mkdir(parents=True)
    (root / "etc" / "passwd").write_text("root:x:0:0:root:/root:/bin/sh\n")
    (root / "etc" / "group").write_text("root:x:0:\n")
    rules = root / "etc" / "udev" / "rules.d" / "60-enliven-cameras.rules"
    rules.write_text("# by hand\n")
    rules.chmod(0o600)
    return root


def snapshot(root: Path) -> dict[str, tuple[int, bytes | str]]:
    """Returns the mode and content of each file and link of a system, except for its users."""
    files: dict[str, tuple[int, bytes | str]] = {}
    for path in sorted(root.rglob("*")):
        name = str(path.relative_to(root))
        if name.split("/")[-1].rstrip("-") in ("passwd", "group", "shadow", "gshadow", ".pwd.lock"):
            continue
        if path.is_symlink():
            files[name] = (0, os.readlink(path))
        else:
            files[name] = (path.stat().st_mode, path.read_bytes() if path.is_file() else "folder")
    return files


@needs_systemd
def test_removal_restores_everything(profile: Path, root: Path) -> None:
    before = snapshot(root)
    install_kiosk(profile, root=root)
    assert (root / "etc/enliven/meshes/horse.mtl").read_text() == "newmtl fur\n"
    assert not (root / "etc/enliven/.hidden").exists()
    assert (root / "etc/systemd/system/multi-user.target.wants/enliven-edge@stairs.service").is_symlink()
    assert (root / "etc/systemd/system/timers.target.wants/enliven-nightly.timer").is_symlink()
    install_kiosk(None, remove=True, root=root)
    after = snapshot(root)
    assert {name: after[name] for name in after if name not in before} == {}
    assert after == before
    assert "enliven" not in (root / "etc/passwd").read_text()


@needs_systemd
def test_second_installation_changes_nothing_and_keeps_the_state_before(profile: Path, root: Path) -> None:
    before = snapshot(root)
    install_kiosk(profile, root=root)
    first = snapshot(root)
    install_kiosk(profile, root=root)
    assert snapshot(root) == first
    install_kiosk(None, remove=True, root=root)
    assert snapshot(root) == before


@needs_systemd
def test_next_installation_removes_what_it_does_not_need(profile: Path, root: Path) -> None:
    install_kiosk(profile, root=root)
    profile.write_text(
        PROFILE.replace('restart_at = "04:00"\n', "").replace("[edges.stairs]\nport = 5600\n", "")
    )
    (profile.parent / "meshes" / "horse.mtl").unlink()
    install_kiosk(profile, root=root)
    names = snapshot(root)
    assert not [name for name in names if "nightly" in name or "stairs" in name or name.endswith(".mtl")]


@needs_systemd
def test_recordings_outlive_the_kiosk(profile: Path, root: Path, capsys) -> None:
    install_kiosk(profile, root=root)
    assert os.readlink(root / "etc/enliven/visits") == "/var/lib/enliven/recordings"
    take = root / "var/lib/enliven/recordings/visit.mcap"
    take.write_bytes(b"a visit")
    (root / "var/lib/enliven/cache").mkdir()
    install_kiosk(None, remove=True, root=root)
    assert "not deleted: /var/lib/enliven/recordings" in capsys.readouterr().out
    assert [path.name for path in (root / "var/lib/enliven").rglob("*")] == ["recordings", "visit.mcap"]
    assert take.read_bytes() == b"a visit"


@needs_systemd
def test_secrets_belong_to_the_user_of_the_kiosk(profile: Path, root: Path) -> None:
    install_kiosk(profile, root=root)
    line = next(x for x in (root / "etc/passwd").read_text().splitlines() if x.startswith("enliven:"))
    secret = (root / "etc/enliven/password").stat()
    assert (secret.st_uid, secret.st_mode & 0o777) == (int(line.split(":")[2]), 0o600)
    assert line.endswith(":/usr/sbin/nologin")


def test_dry_run_shows_all_and_changes_nothing(profile: Path, root: Path, capsys) -> None:
    before = snapshot(root)
    install_kiosk(profile, dry_run=True, root=root)
    assert snapshot(root) == before
    shown = capsys.readouterr().out
    plan = create_plan(load_profile(profile), profile)
    for file in plan.files:
        assert str(file.place) in shown
    assert "WatchdogSec=10" in shown and "OnCalendar=*-*-* 04:00:00" in shown
    assert "enliven-edge@edge.service enliven-edge@stairs.service enliven-kiosk.service" in shown
    assert "@" not in "".join(line for line in shown.splitlines() if line.startswith("ExecStart=/"))


def test_mistakes_are_named_together_and_nothing_is_written(profile: Path, tmp_path: Path, capsys) -> None:
    bare = tmp_path / "bare"
    bare.mkdir()
    profile.write_text('[characters.horse]\nmesh = "gone.obj"\n[edges.edge]\nsettings = "gone.toml"\n')
    with pytest.raises(typer.Exit):
        install_kiosk(profile, root=bare)
    lines = capsys.readouterr().err.splitlines()
    assert [line for line in lines if "apt-get install cage" in line]
    assert [line for line in lines if "apt-get install seatd" in line]
    assert [line for line in lines if "mesh file gone.obj" in line]
    assert [line for line in lines if "settings file gone.toml" in line]
    assert list(bare.iterdir()) == []


def test_file_outside_of_the_folder_is_refused(profile: Path, root: Path, capsys) -> None:
    (profile.parent.parent / "horse.obj").write_text("v 0 0 0\n")
    profile.write_text('[characters.horse]\nmesh = "../horse.obj"\n')
    with pytest.raises(typer.Exit):
        install_kiosk(profile, root=root)
    assert "the file in characters.horse.mesh is outside the profile's folder" in capsys.readouterr().err


def test_home_directory_is_not_installed(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setenv("HOME", str(tmp_path))
    (tmp_path / "foyer.toml").write_text("")
    with pytest.raises(InputError, match="to a separate folder"):
        create_plan(load_profile(tmp_path / "foyer.toml"), tmp_path / "foyer.toml")


def test_removal_without_an_installation_is_refused(root: Path) -> None:
    before = snapshot(root)
    with pytest.raises(InputError, match="no kiosk is installed"):
        Installer(root).remove()
    assert snapshot(root) == before


@pytest.mark.skipif(os.geteuid() != 0, reason="only root can become another user")
def test_ordinary_user_is_refused_with_the_command_to_type(monkeypatch) -> None:
    monkeypatch.setattr(os, "geteuid", lambda: 1000)
    assert any("sudo enliven install-kiosk" in str(lack) for lack in find_lacks(Path("/")))


def test_server_of_souvenirs_is_installed_only_if_the_profile_makes_them(profile: Path) -> None:
    assert "enliven-souvenirs.service" in create_plan(load_profile(profile), profile).units
    profile.write_text(PROFILE.replace('kind = "photo"', 'kind = ""'))
    plan = create_plan(load_profile(profile), profile)
    assert "enliven-souvenirs.service" not in plan.units
    assert not [file for file in plan.files if "souvenirs" in file.place.name]


def test_percent_sign_in_a_path_is_no_specifier_of_systemd(profile: Path) -> None:
    plan = create_plan(load_profile(profile), profile, python="/opt/100% art/bin/python")
    unit = next(file for file in plan.files if file.place.name == "enliven-health.service")
    assert unit.content is not None and "'/opt/100%% art/bin/python' -m enliven" in unit.content.decode()


@needs_systemd
@pytest.mark.parametrize(
    "unit",
    [
        "enliven-edge@a.service",
        "enliven-kiosk.service",
        "enliven-health.service",
        "enliven-backoff.timer",
        "enliven-souvenirs.service",
        "enliven-nightly.timer",
    ],
)
def test_units_are_valid(profile: Path, tmp_path: Path, unit: str) -> None:
    folder = write_units(profile, tmp_path)
    place = folder / unit.replace("@a", "@")
    target = folder / unit
    if target != place:
        target.symlink_to(place)
    own = {**os.environ, "SYSTEMD_UNIT_PATH": f"{folder}:"}
    command = ["systemd-analyze", "verify", "--man=no", "--recursive-errors=no", str(target)]
    done = subprocess.run(command, env=own, capture_output=True, text=True, check=False)
    assert (done.stderr, done.returncode) == ("", 0)


@needs_systemd
@pytest.mark.parametrize(
    "unit", [*(f"enliven-{name}" for name in UNITS), "enliven-backoff", "enliven-nightly"]
)
def test_units_can_do_little_harm(profile: Path, tmp_path: Path, unit: str) -> None:
    place = write_units(profile, tmp_path) / f"{unit}.service"
    command = ["systemd-analyze", "security", "--offline=true", f"--threshold={MAX_EXPOSURE}", str(place)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr


MAX_EXPOSURE = 25
"""Maximum exposure by systemd-analyze, in tenths. 100 is a service without restrictions, 50 is medium."""


def systemd_version() -> int:
    """Returns the version of systemd's tools, 0 if they are not installed."""
    if shutil.which("systemd-analyze") is None:
        return 0
    done = subprocess.run(["systemd-analyze", "--version"], capture_output=True, text=True, check=True)
    return int(done.stdout.split()[1])


KNOWS_GROWING_WAITS = systemd_version() >= 254


def write_units(profile: Path, folder: Path) -> Path:
    """Writes the units of a plan into one folder, with programs that exist here, and returns the folder."""
    units = folder / "units"
    units.mkdir()
    for file in create_plan(load_profile(profile), profile, cage="/bin/sh").files:
        if file.content is not None and file.place.suffix in (".service", ".timer"):
            lines = file.content.decode().splitlines(keepends=True)
            if not KNOWS_GROWING_WAITS:
                # An older systemd ignores such settings with a warning.
                lines = [line for line in lines if not line.startswith(("RestartSteps", "RestartMaxDelay"))]
            (units / file.place.name).write_text("".join(lines))
    (units / "seatd.service").write_text("[Service]\nExecStart=/bin/sh\n")
    return units
