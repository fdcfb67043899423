"""Checks glTF files with Khronos' glTF-Validator, which runs in Node.js."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
from collections.abc import Sequence
from pathlib import Path

PACKAGE = Path(
    os.environ.get(
        "ENLIVEN_GLTF_VALIDATOR",
        Path(__file__).parents[2] / "out" / "web" / "node_modules" / "gltf-validator",
    )
)
"""The folder of the npm package gltf-validator, which `make test-web` fetches."""
MISSING_REASON = (
    "Node.js is not installed"
    if shutil.which("node") is None
    else ""
    if (PACKAGE / "package.json").is_file()
    else "gltf-validator is not here: make test-web"
)
"""The reason why no file can be checked; empty if everything is installed."""
_TIMEOUT_S = 120.0
"""Timeout for all files of a call, seconds. A file of a megabyte takes 0.2 s."""
_PROGRAM = """
const [validator, fs] = [require(process.argv[1]), require('fs')];
(async () => {
  const found = [];
  for (const path of process.argv.slice(2)) {
    const report = await validator.validateBytes(new Uint8Array(fs.readFileSync(path)));
    for (const {severity, code, message, pointer} of report.issues.messages)
      if (severity < 2) found.push(`${path}: ${code} ${message} ${pointer ?? ''}`);
  }
  console.log(JSON.stringify(found));
})();
"""


def find_errors(paths: Sequence[Path]) -> list[str]:
    """Returns the errors and warnings of the validator for GLB files, each with the file and the place."""
    command = ["node", "-e", _PROGRAM, str(PACKAGE), *map(str, paths)]
    result = subprocess.run(command, capture_output=True, text=True, timeout=_TIMEOUT_S, check=True)
    return list(json.loads(result.stdout))
