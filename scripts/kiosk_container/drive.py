"""Tests a kiosk in a container with systemd: installs it, kills each program, and simulates power cuts.

scripts/test_kiosk.sh creates the root file system of the container and calls this script. The report is
out/kiosk/report.json.
"""

from __future__ import annotations

import argparse
import json
import random
import subprocess
import sys
import time
from pathlib import Path

from container import Container

OUT = Path("out/kiosk")
"""Folder of the report and the screenshots."""
EDGE, WINDOW, HEALTH = "enliven-edge@edge", "enliven-kiosk", "enliven-health"
"""Systemd units of the kiosk."""
UNITS = (EDGE, WINDOW, HEALTH)
"""All units, which must be active."""
SOURCE = "/opt/enliven/scripts/kiosk_container"
"""Folder of the profile and scripts in the container."""
FIRST_START_S = 1800.0
"""Maximum seconds of the first start, which compiles all kernels."""
START_S = 300.0
"""Maximum seconds from power on until all programs are ready, on a busy machine."""
POWER_CUT_WINDOW_S = (0.0, 30.0)
"""Interval in seconds after the start of a recording. A power cut happens at a random time in it."""
MAX_LOST_S = 1.0
"""Maximum seconds of a recording that a power cut may lose."""
DISK_SIZE = "512M"
"""Size of the partition that contains all data of the kiosk."""


def install(root: Path, disk: Path) -> float:
    """Installs the kiosk, and returns the time of its first start in seconds. The partition is created
    again.
    """
    disk.unlink(missing_ok=True)
    subprocess.run(["mke2fs", "-q", "-t", "ext4", str(disk), DISK_SIZE], check=True)
    container = Container(root, disk)
    try:
        container.run(f"mkdir -p /srv/kiosk && cp {SOURCE}/foyer.toml /srv/kiosk/")
        # The folder is part of the new file system. So the removal would keep it.
        container.run("rmdir /var/lib/enliven/lost+found")
        print(container.run("enliven install-kiosk /srv/kiosk/foyer.toml"), flush=True)
        started_s = time.monotonic()
        wait_until_ready(container, FIRST_START_S)
        return time.monotonic() - started_s
    finally:
        container.run("systemctl stop 'enliven-*'")
        container.close()


def wait_until_ready(container: Container, timeout_s: float = START_S) -> None:
    """Waits until all units are active. Each program has then reported that it is ready.

    Raises:
        TimeoutError: if a unit is not active. The message contains its log.
    """
    deadline = time.monotonic() + timeout_s
    while True:
        states = container.try_run(f"systemctl is-active {' '.join(UNITS)}").stdout.split()
        if states == ["active"] * len(UNITS):
            return
        if time.monotonic() > deadline:
            log = container.try_run("journalctl -b -n 60 --no-pager -u 'enliven-*' -u seatd").stdout
            raise TimeoutError(f"{dict(zip(UNITS, states, strict=False))}\n{log}")
        time.sleep(0.5)


def wait_for_recording(container: Container, timeout_s: float = START_S) -> None:
    """Waits until the edge has reported frames, and has written some of them to its recording.

    Raises:
        TimeoutError: if it does not happen. The message contains the edge's log.
    """
    before, deadline = container.recorded_bytes(), time.monotonic() + timeout_s
    while not container.read_edge_figures().get("frames") or container.recorded_bytes() <= before:
        if time.monotonic() > deadline:
            log = container.try_run(f"journalctl -b -n 60 --no-pager -u {EDGE}").stdout
            raise TimeoutError(f"the edge has recorded nothing after {timeout_s:g} s\n{log}")
        time.sleep(0.05)


def active_since_s(container: Container, unit: str) -> float:
    """Returns the time in seconds of the monotonic clock at which a unit became active."""
    return int(container.run(f"systemctl show -P ActiveEnterTimestampMonotonic {unit}")) * 1e-6


def start_duration_s(container: Container) -> float:
    """Returns the seconds from the start of systemd until the window had drawn its first image."""
    began_s = int(container.run("systemctl show -P UserspaceTimestampMonotonic")) * 1e-6
    return active_since_s(container, WINDOW) - began_s


def kill_each(container: Container) -> dict[str, float]:
    """Kills each program, and returns the seconds until it was ready again."""
    targets = {
        "edge": (EDGE, f"$(systemctl show -P MainPID {EDGE})"),
        "compositor": (WINDOW, f"$(systemctl show -P MainPID {WINDOW})"),
        "window": (WINDOW, "$(pgrep -f '^/opt/venv/bin/python3 -m enliven kiosk-window')"),
        "health": (HEALTH, f"$(systemctl show -P MainPID {HEALTH})"),
    }
    recoveries = {}
    for name, (unit, pid) in targets.items():
        before_s = active_since_s(container, unit)
        killed_s = float(container.run(f"kill -9 {pid} && cut -d' ' -f1 /proc/uptime"))
        deadline = time.monotonic() + START_S
        while active_since_s(container, unit) <= before_s:
            if time.monotonic() > deadline:
                raise TimeoutError(f"{name} was not restarted in time")
            time.sleep(0.1)
        recoveries[name] = round(active_since_s(container, unit) - killed_s, 2)
        print(f"{name} was killed, and was ready again after {recoveries[name]} s", flush=True)
    return recoveries


def freeze_window(container: Container) -> float:
    """Stops the window's process like a frozen program, and returns the seconds until it was ready again."""
    before_s = active_since_s(container, WINDOW)
    window = "$(pgrep -f '^/opt/venv/bin/python3 -m enliven kiosk-window')"
    frozen_s = float(container.run(f"kill -STOP {window} && cut -d' ' -f1 /proc/uptime"))
    deadline = time.monotonic() + START_S
    while active_since_s(container, WINDOW) <= before_s:
        if time.monotonic() > deadline:
            raise TimeoutError("the frozen window was not restarted in time")
        time.sleep(0.2)
    return round(active_since_s(container, WINDOW) - frozen_s, 2)


def measure(root: Path, disk: Path) -> dict[str, object]:
    """Boots once, and measures the cold start and the recovery of each program."""
    container = Container(root, disk)
    try:
        wait_until_ready(container)
        report: dict[str, object] = {"cold_start_s": round(start_duration_s(container), 1)}
        time.sleep(3.0)
        container.screenshot(OUT / "attract.png")
        report["recover_s"] = kill_each(container)
        report["recover_frozen_s"] = freeze_window(container)
        time.sleep(3.0)
        container.screenshot(OUT / "after-kills.png")
        history = container.run("cat /var/lib/enliven/state/enliven/restarts.jsonl")
        report["restarts"] = [json.loads(line) for line in history.splitlines()]
        container.run("systemctl stop 'enliven-*'")
        return report
    finally:
        container.close()


def cut_power(root: Path, disk: Path, seed: int) -> dict[str, object]:
    """Boots, cuts the power at a random moment of a recording, boots again, and checks the recordings."""
    moment_s = random.Random(seed).uniform(*POWER_CUT_WINDOW_S)
    powered_s = time.time()
    container = Container(root, disk)
    try:
        wait_for_recording(container)
    except TimeoutError:
        container.close()
        raise
    began_s = time.time()
    time.sleep(moment_s)
    figures = container.read_edge_figures()
    cut_s = container.cut_power()
    result: dict[str, object] = {"recording_after_s": round(began_s - powered_s, 1)}
    result["cut_after_s"] = round(moment_s, 1)
    container = Container(root, disk)
    try:
        result |= json.loads(
            container.run(f"python {SOURCE}/last_take.py {cut_s:.3f} {cut_s - powered_s:.3f}")
        )
        result["lost_s"] = lost_s(figures, result["recorded_frames"])
        wait_until_ready(container)
        result["attract_after_s"] = round(start_duration_s(container), 1)
        time.sleep(1.0)
        container.screenshot(OUT / f"after-cut-{seed:02d}.png")
        return result
    finally:
        container.run("systemctl stop 'enliven-*'")
        container.close()


def lost_s(figures: dict[str, float], recorded_frames: object) -> float | None:
    """Returns the seconds of a recording that were lost, or None if the edge had not reported its frames yet.

    Args:
        figures: measurements of the edge just before the power cut.
        recorded_frames: number of frames in the recording of that run; None without a file.
    """
    if not figures.get("frames") or not figures.get("fps"):
        return None
    recorded = recorded_frames if isinstance(recorded_frames, int) else 0
    return round(max(0.0, figures["frames"] - recorded) / figures["fps"], 2)


def find_faults(cuts: list[dict[str, object]]) -> list[str]:
    """Returns a sentence for each bad power cut: it hit no recording, lost too much, or damaged a file."""
    faults = []
    for number, cut in enumerate(cuts, 1):
        lost_s = cut["lost_s"]
        if lost_s is None or cut["recorded_frames"] is None:
            faults.append(f"power cut {number}: no recording of that run was found")
        if cut["unreadable"]:
            faults.append(f"power cut {number}: {cut['unreadable']}")
        if isinstance(lost_s, float) and lost_s > MAX_LOST_S:
            faults.append(f"power cut {number}: {lost_s} s of the recording are lost")
    return faults


def main() -> int:
    """Runs the whole test. Returns its exit code."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--root", type=Path, required=True, help="root folder of the container")
    parser.add_argument(
        "--disk", type=Path, required=True, help="image file of the container's data partition"
    )
    parser.add_argument("--kills", type=int, default=20, help="number of simulated power cuts")
    parser.add_argument("--keep", action="store_true", help="use the kiosk that an earlier run installed")
    options = parser.parse_args()
    OUT.mkdir(parents=True, exist_ok=True)
    report: dict[str, object] = {}
    if not (options.keep and options.disk.exists()):
        report["first_start_s"] = round(install(options.root, options.disk), 1)
    report |= measure(options.root, options.disk)
    cuts: list[dict[str, object]] = []
    report["cuts"] = cuts
    for seed in range(options.kills):
        cuts.append(cut_power(options.root, options.disk, seed))
        print(f"power cut {seed + 1} of {options.kills}: {cuts[-1]}", flush=True)
        (OUT / "report.json").write_text(json.dumps(report, indent=2) + "\n")
    (OUT / "report.json").write_text(json.dumps(report, indent=2) + "\n")
    print(json.dumps(report, indent=2))
    faults = find_faults(cuts)
    losses = [cut["lost_s"] for cut in cuts if isinstance(cut["lost_s"], float)]
    longest_s = max(losses, default=0.0)
    print(
        f"{len(losses)} of {len(cuts)} power cuts hit a recording, and at most {longest_s} s of it were lost"
    )
    print("\n".join(faults) or "the kiosk restarted after each kill and each power cut")
    return bool(faults)


if __name__ == "__main__":
    sys.exit(main())
