"""Hooks of the documentation site: pages from outside ``docs/``, links into the code, and the API page.

MkDocs reads only one folder of pages. The start page, the changelog and the pages of the packages are in
other folders of the checkout, where code hosts show them. This module adds them to the site, and rewrites
links to the site's paths. A link to a file outside the site, such as a module, becomes plain text.
"""

from __future__ import annotations

import posixpath
import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from mkdocs.config.defaults import MkDocsConfig
    from mkdocs.structure.files import Files
    from mkdocs.structure.pages import Page

ROOT = Path(__file__).parents[1]
ADDED = {
    "README.md": "index.md",
    "CONTRIBUTING.md": "contributing.md",
    "CHANGELOG.md": "changelog.md",
    "SECURITY.md": "security.md",
    "examples/README.md": "examples-gallery.md",
    "firmware_configs/README.md": "firmware-configs.md",
    "shared/README.md": "package-enliven.md",
    "edge/README.md": "package-edge.md",
    "viewer/README.md": "package-viewer.md",
    "synthesis/README.md": "package-synthesis.md",
    "kernels/README.md": "package-kernels.md",
}
"""Pages outside ``docs/``, as paths relative to the checkout, with their names in the site."""
PICTURES = sorted(path.relative_to(ROOT).as_posix() for path in (ROOT / "examples").rglob("*.png"))
"""Pictures outside ``docs/``, as paths relative to the checkout. They have the same paths in the site."""
LINK = re.compile(r"(!?)\[((?:[^\[\]]|\[[^\]]*\])*)\]\(([^()\s#]+)(#[^()\s]*)?\)")
"""Pattern of a Markdown link or picture.

The groups are mark, text, target without anchor, and anchor. Links that consist only of an anchor do not
match."""
API = "api.md"
"""The page of the public API of the library."""


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Adds the pages from outside ``docs/``, their pictures, and the page of the API."""
    from mkdocs.structure.files import File  # Only `make docs` has MkDocs, and the tests import this module.

    for path, uri in ADDED.items():
        files.append(File.generated(config, uri, content=(ROOT / path).read_text(encoding="utf-8")))
    for path in PICTURES:
        files.append(File.generated(config, path, abs_src_path=str(ROOT / path)))
    files.append(File.generated(config, API, content=make_api_page()))
    return files


def on_page_markdown(markdown: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Returns a page with its links rewritten for the site."""
    sources = {uri: path for path, uri in ADDED.items()}
    uri = page.file.src_uri
    source = sources.get(uri, f"docs/{uri}")

    def rewrite(match: re.Match[str]) -> str:
        return rewrite_link(match, source, uri, files)

    return LINK.sub(rewrite, markdown)


def on_page_content(html: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Returns a page in which Sphinx roles of docstrings, such as :func:, are replaced by code formatting."""
    if page.file.src_uri != API:
        return html
    html = re.sub(r":(?:class|func|meth|mod|attr|data|obj):(?=<code>)", "", html)
    return re.sub(r"<code>~?(?:[a-z_]+\.)+(\w+)</code>", r"<code>\1</code>", html)


def rewrite_link(match: re.Match[str], source: str, uri: str, files: Any) -> str:
    """Returns a link of a page rewritten for the site, or the link's text if its target is not in the site.

    Args:
        match: a match of :data:`LINK`.
        source: the page's path in the checkout.
        uri: the page's path in the site.
        files: the site's files, which have the method ``get_file_from_path``.
    """
    mark, text, target, anchor = match.groups()
    if re.match(r"[a-z]+:", target):
        return match[0]
    path = posixpath.normpath(posixpath.join(posixpath.dirname(source), target))
    site_path = ADDED.get(path, path.removeprefix("docs/"))
    if files.get_file_from_path(site_path) is None:
        return text
    relative = posixpath.relpath(site_path, posixpath.dirname(uri) or ".")
    return f"{mark}[{text}]({relative}{anchor or ''})"


def make_api_page() -> str:
    """Returns the page of the names that ``from enliven import ...`` offers."""
    head = (
        "# Library API\n\nFor authors of scripts: the names that `from enliven import ...` offers, with "
        "their parameters. [The library page](library.md) shows each at work.\n"
    )
    names = sorted(list_exported("enliven").items(), key=lambda item: item[0].lower())
    return head + "".join(f"\n::: {module}.{name}\n" for name, module in names if module)


def list_exported(package: str) -> dict[str, str]:
    """Returns the names that a package's stub exports, each with the module that defines it."""
    folder = ROOT / "shared" / Path(*package.split("."))
    stub = (folder / "__init__.pyi").read_text(encoding="utf-8")
    result = {}
    for module, names in re.findall(r"^from \.([\w.]+) import (\([^)]*\)|.*)$", stub, re.MULTILINE):
        for name in re.findall(r"(\w+)(?: as \w+)?", re.sub(r" as \w+", "", names)):
            result[name] = find_defining_module(f"{package}.{module}", name)
    return result


def find_defining_module(module: str, name: str) -> str:
    """Returns the module that defines a name.

    The name is imported from ``module``, which is a module or a package with a stub.
    """
    folder = ROOT / "shared" / Path(*module.split("."))
    if not (folder / "__init__.pyi").exists():
        return module
    return list_exported(module).get(name, module)
