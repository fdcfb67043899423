"""Counts sentences and names that readers have to read twice, per package, for a ratchet that only falls.

    python tests/conventions/prose.py --places shared/enliven/wire    # lists the places of a package
    python tests/conventions/prose.py --update   # writes prose.toml, after texts were improved

``docs/style.md`` says what to write instead.
"""

from __future__ import annotations

import argparse
import ast
import re
import subprocess
import sys
import tokenize
import tomllib
from collections import Counter, defaultdict
from collections.abc import Iterator
from dataclasses import dataclass
from io import StringIO
from pathlib import Path

from source_tree import list_nodes

ROOT = Path(__file__).parents[2]
LIMITS = Path(__file__).with_name("prose.toml")
"""The committed number of findings for each package and rule."""
PROGRAMS = ("shared", "edge", "viewer", "synthesis", "tests", "examples", "scripts", "kernels")
_HUMANS = (
    *(
        "people",
        "person",
        "performer",
        "visitor",
        "artist",
        "technician",
        "developer",
        "programmer",
        "engineer",
    ),
    *("bystander", "user", "operator", "everyone", "anyone"),
)
_NOT_AFTER_HUMANS = "".join(rf"(?<!\b{noun} who)(?<!\b{noun}s who)" for noun in _HUMANS)
"""Words before "who" with which it is plain English, as a pattern that follows "who"."""
CONSTRUCTIONS = {
    "What/Who as a subject": re.compile(r"(?:^|[.:;]\s+)(?:What|Who|Whom)\s+(?!is\b.*\?)\w+", re.MULTILINE),
    "of what": re.compile(
        r"\b(?:of|by|with|to|from|for|than|in|and|or|over|as|into|on)\s+what\b", re.IGNORECASE
    ),
    "of which": re.compile(r"\b(?:of|by|out of|from|than|on) which\b", re.IGNORECASE),
    "who": re.compile(r"\bwho\b" + _NOT_AFTER_HUMANS, re.IGNORECASE),
    "beside": re.compile(r"\bbeside\b", re.IGNORECASE),
    "is no": re.compile(r"\b(?:is|are|was|were) no (?!longer)\w+", re.IGNORECASE),
    "as it is": re.compile(r"\bas (?:it|they) (?:is|was|stands|were|are)\b", re.IGNORECASE),
    "so many": re.compile(r"\bso (?:many|much|far|long)\b", re.IGNORECASE),
    "anew, in vain": re.compile(r"\b(?:anew|in vain)\b", re.IGNORECASE),
    "somebody, whose": re.compile(
        r"\b(?:somebody|nobody|whoever|whomever|whose)\b", re.IGNORECASE
    ),
}  # fmt: skip
"""Constructions that were 10 to 50 times as frequent here as in projects that are easy to read."""
_PAGES_APART = ("docs/settings.md", "docs/style.md")
"""Pages that are not counted: one is made from docstrings, the other quotes what not to write."""
MOST_WORDS = 30
"""Maximum words of a docstring's sentence. Longer ones are counted. Sentences with code or formulas count as
well.
"""
VAGUE_LOCALS = {"one", "found", "made", "said", "told", "what", "known"}
"""Names of variables that do not say what they hold."""
VAGUE_NAMES = re.compile(
    r"(?:told|made|said|found|given|seen|known|sought|carrying|meeting|standing|growing|telling|playing|"
    r"handling|served|beside)",
    re.IGNORECASE,
)
"""Names of modules and classes that are not nouns."""
VAGUE_CONSTANT = re.compile(r"_[A-Z]+(?:LY|EST)")
"""Private constants named by an adverb or a superlative, which do not say what they bound."""


@dataclass(frozen=True)
class Text:
    """A text of the project: its file and line, and its kind (docstring, comment, message, page)."""

    path: str
    line: int
    kind: str
    words: str


@dataclass(frozen=True)
class Finding:
    """A place that breaks a rule."""

    rule: str
    path: str
    line: int
    words: str


def package_of(path: str) -> str:
    """Returns the package to which a file belongs: three path components for programs, two for tests and
    docs.
    """
    parts = path.split("/")[:-1]
    depth = 4 if "studio" in parts else 3 if parts[:1] in (["shared"], ["edge"], ["viewer"]) else 2
    return "/".join(parts[:depth]) or "."


def findings(root: Path = ROOT) -> Iterator[Finding]:
    """Yields all findings in a checkout."""
    listed = subprocess.run(["git", "-C", str(root), "ls-files"], capture_output=True, text=True, check=True)
    for path in listed.stdout.split("\n"):
        if not (root / path).is_file():
            continue
        if path.endswith(".py") and path.split("/")[0] in PROGRAMS:
            yield from of_module(path, (root / path).read_text(encoding="utf-8"))
        elif path.endswith(".md") and path not in _PAGES_APART:
            yield from of_text(Text(path, 1, "page", (root / path).read_text(encoding="utf-8")))


def of_module(path: str, source: str) -> Iterator[Finding]:
    """Yields the findings in a Python file."""
    nodes = list_nodes(ast.parse(source))
    for text in texts_of(path, source, nodes):
        yield from of_text(text)
    for node in nodes:
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef) and not path.startswith("tests/"):
            yield from _verb(path, node)
        elif isinstance(node, ast.ClassDef) and VAGUE_NAMES.fullmatch(node.name.lstrip("_")):
            yield Finding("names", path, node.lineno, node.name)
        elif isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
            if node.id in VAGUE_LOCALS:
                yield Finding("locals", path, node.lineno, node.id)
            elif VAGUE_CONSTANT.fullmatch(node.id):
                yield Finding("names", path, node.lineno, node.id)
    if VAGUE_NAMES.fullmatch(Path(path).stem):
        yield Finding("names", path, 1, Path(path).stem)


def texts_of(path: str, source: str, nodes: list[ast.AST]) -> Iterator[Text]:
    """Yields docstrings, comments, and strings of at least four words in a Python file with these nodes.

    Comments are left out if none of them contains a discouraged construction.
    """
    docstrings = set()
    for node in nodes:
        body = getattr(node, "body", None)
        for statement in body if isinstance(body, list) else ():
            value = statement.value if isinstance(statement, ast.Expr) else None
            if isinstance(value, ast.Constant) and isinstance(value.value, str):
                docstrings.add(id(value))
                yield Text(path, statement.lineno, "docstring", value.value)
    for node in nodes:
        is_string = isinstance(node, ast.Constant) and isinstance(node.value, str)
        is_message = is_string and id(node) not in docstrings and node.value.count(" ") >= 3
        if is_message and not path.startswith("tests/"):
            yield Text(path, node.lineno, "message", node.value)
    # Tokens take most of the time, and a comment is only searched for constructions.
    ends = [end.lstrip() for line in source.splitlines() for end in line.split("#")[1:]]
    is_suspect = any(each.search(end) for end in ends for each in CONSTRUCTIONS.values())
    for token in tokenize.generate_tokens(StringIO(source).readline) if is_suspect else ():
        if token.type == tokenize.COMMENT:
            yield Text(path, token.start[0], "comment", token.string.lstrip("# "))


def of_text(text: Text) -> Iterator[Finding]:
    """Yields the discouraged constructions of a text, and the long sentences of a docstring."""
    for construction in CONSTRUCTIONS.values():
        for match in construction.finditer(text.words):
            line = text.line + text.words[: match.start()].count("\n")
            yield Finding("constructions", text.path, line, match[0].strip())
    for sentence in re.split(r"[.;:!?]\s|\n\s*\n", text.words) if text.kind == "docstring" else ():
        if len(sentence.split()) > MOST_WORDS:
            yield Finding("long sentences", text.path, text.line, " ".join(sentence.split()))


def _verb(path: str, node: ast.FunctionDef | ast.AsyncFunctionDef) -> Iterator[Finding]:
    """Yields a finding if a function's docstring does not start with a verb in the third person.

    The docstring of a command is its ``--help``, which is in the imperative. It is recognised by the mark
    ``\\b`` before its examples.
    """
    docstring = ast.get_docstring(node) or ""
    words = docstring.split() if "\b" not in docstring else []
    is_property = any("property" in ast.unparse(each) for each in node.decorator_list)
    if words and not is_property and not re.fullmatch(r"[A-Z][a-z]+s", words[0].rstrip(",:")):
        yield Finding("no verb", path, node.lineno, " ".join(words[:6]))


def counts(found: Iterator[Finding]) -> dict[str, Counter[str]]:
    """Returns the number of findings for each package and rule."""
    result: dict[str, Counter[str]] = defaultdict(Counter)
    for finding in found:
        result[package_of(finding.path)][finding.rule] += 1
    return result


def limits(path: Path = LIMITS) -> dict[str, dict[str, int]]:
    """Returns the committed counts for each package and rule."""
    return tomllib.loads(path.read_text(encoding="utf-8"))


def compare(now: dict[str, Counter[str]], committed: dict[str, dict[str, int]]) -> list[str]:
    """Returns a sentence for each count that rose, and for each that fell without an update of the committed
    counts.
    """
    sentences = []
    for package in sorted({*now, *committed}):
        for rule in sorted({*now.get(package, {}), *committed.get(package, {})}):
            count, limit = now.get(package, Counter())[rule], committed.get(package, {}).get(rule, 0)
            if count > limit:
                sentences.append(
                    f"{package}: {rule} rose from {limit} to {count}. Write them as docs/style.md advises; "
                    f"python tests/conventions/prose.py --places {package} lists the places."
                )
            elif count < limit:
                sentences.append(
                    f"{package}: {rule} fell from {limit} to {count}: "
                    "python tests/conventions/prose.py --update"
                )
    return sentences


def write_limits(now: dict[str, Counter[str]], path: Path = LIMITS) -> None:
    """Writes the current counts as the new limits."""
    lines = ["# Counts that may only fall: python tests/conventions/prose.py --update writes them.\n"]
    for package in sorted(now):
        values = ", ".join(f'"{rule}" = {count}' for rule, count in sorted(now[package].items()) if count)
        lines.append(f'"{package}" = {{ {values} }}\n')
    path.write_text("".join(lines), encoding="utf-8")


def main() -> int:
    """Prints the counts, or the places of a package, or writes the limits."""
    parser = argparse.ArgumentParser(description="Count sentences and names that have to be read twice.")
    parser.add_argument("--update", action="store_true", help="write the counts of now as the limits")
    parser.add_argument(
        "--places", metavar="PACKAGE", help="list the places of a package, such as shared/enliven/wire"
    )
    parser.add_argument(
        "--rule", help="list only this rule: constructions, 'long sentences', 'no verb', locals, names"
    )
    asked = parser.parse_args()
    found = list(findings())
    for finding in found if asked.places else ():
        if package_of(finding.path) == asked.places and asked.rule in (None, finding.rule):
            print(f"{finding.path}:{finding.line}: {finding.rule}: {finding.words[:100]}")
    now = counts(iter(found))
    print(dict(sum(now.values(), Counter())))
    if asked.update:
        write_limits(now)
    return 0


if __name__ == "__main__":
    sys.exit(main())
