"""Extracts the code blocks of a document and the command lines in them."""

from __future__ import annotations

import re
import shlex
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[2]
PAGES = sorted([*ROOT.glob("*.md"), *ROOT.glob("*/README.md"), *(ROOT / "docs").rglob("*.md")])
TOOLS = ("enliven", "make", "pip", "sudo", ".", ".venv/bin/python")
"""First words of lines that are commands."""
_REASON = re.compile(r"<!-- not run: (.+) -->")
_FENCE = "```"


@dataclass(frozen=True)
class Block:
    """A block of code.

    Attributes:
        page: the document.
        line: number of its first line, from 1.
        kind: shell, python, toml, or text.
        text: its text without the fence or the four spaces before each line.
        reason: the reason from the comment before it for not running the block, empty if it is run.
    """

    page: Path
    line: int
    kind: str
    text: str
    reason: str

    def __str__(self) -> str:
        return f"{self.page.relative_to(ROOT)}:{self.line}"

    @property
    def commands(self) -> list[list[str]]:
        """Returns the words of each command without comments. ``&&`` separates two commands."""
        lines = [part for line in self.text.splitlines() for part in line.split(" && ")]
        return [words for line in lines if (words := shlex.split(line, comments=True))]


def blocks_of(page: Path) -> list[Block]:
    """Returns all blocks of a document, which are fenced or indented by four spaces."""
    lines, blocks, reason, n = page.read_text(encoding="utf-8").splitlines(), [], "", 0
    while n < len(lines):
        line, start = lines[n], n
        if line.startswith(_FENCE):
            n = lines.index(_FENCE, n + 1) + 1
            blocks.append(
                Block(page, start + 1, line[3:], "\n".join(lines[start + 1 : n - 1]) + "\n", reason)
            )
        elif line.startswith("    ") and not (start and lines[start - 1].strip()):
            while n < len(lines) and (lines[n].startswith("    ") or not lines[n]):
                n += 1
            text = "\n".join(part[4:] for part in lines[start:n]).rstrip() + "\n"
            blocks.append(Block(page, start + 1, _kind(text), text, reason))
        else:
            n += 1
        reason_match = _REASON.fullmatch(line.strip())
        # A reason applies to the next block, across blank lines.
        reason = reason_match[1] if reason_match else reason if not line.strip() else ""
    return blocks


def _kind(text: str) -> str:
    """Guesses the kind of a block without a fence from its first line."""
    first = text.split(maxsplit=1)[0]
    if first in TOOLS:
        return "shell"
    return "toml" if re.match(r"\[|\w+ = ", text) else "text"
