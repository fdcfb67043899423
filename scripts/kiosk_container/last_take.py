"""Runs in the container after a power cut: prints the state of the recordings as JSON.

Usage: last_take.py UNIX_TIME_OF_THE_CUT SECONDS_FROM_POWER_ON_TO_THE_CUT
"""

import json
import subprocess
import sys
from pathlib import Path

from enliven.errors import EnlivenError
from enliven.recording import Recording


def born_s(path: Path) -> float:
    """Returns the Unix time at which a file was created."""
    words = ["stat", "--format=%.9W", str(path)]
    return float(subprocess.run(words, capture_output=True, text=True, check=True).stdout)


def main(cut_s: float, run_s: float) -> dict[str, object]:
    """Returns the number of recordings, the unreadable ones, and the number of frames in this run's last
    recording.
    """
    frames: dict[float, int] = {}
    unreadable = []
    for path in Path("/var/lib/enliven/recordings").glob("*.mcap"):
        try:
            # Some topics have one message per frame. Others, such as the heartbeat, have fewer.
            frames[born_s(path)] = max((t.count for t in Recording(path).info.topics.values()), default=0)
        except EnlivenError as error:
            unreadable.append(f"{path.name}: {error}")
    of_this_run = [born for born in frames if cut_s - run_s < born < cut_s]
    recorded = frames[max(of_this_run)] if of_this_run else None
    return {"takes": len(frames), "unreadable": unreadable, "recorded_frames": recorded}


if __name__ == "__main__":
    print(json.dumps(main(float(sys.argv[1]), float(sys.argv[2]))))
