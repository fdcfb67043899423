"""The files of the web page. ``page.js`` is built from integrations/web, and contains three.js."""

from __future__ import annotations

import html
from importlib.resources import files

PAGE_FILES = {"page.html": "text/html", "page.css": "text/css", "page.js": "text/javascript"}
"""The files of the page, and their media types."""
_LICENCES = "LICENCES.txt"
_STYLE_LINK = '<link rel="stylesheet" href="page.css">'
_SCRIPT_LINK = '<script src="page.js"></script>'


def read_page_file(name: str) -> bytes:
    """Returns the bytes of a file of the page.

    Raises:
        KeyError: if the name is not in :data:`PAGE_FILES`.
    """
    if name not in PAGE_FILES:
        raise KeyError(name)
    return _read(name)


def make_standalone_page(title: str, take: str) -> bytes:
    """Returns a standalone page with embedded style, script and take, as UTF-8.

    Args:
        title: the title, as plain text.
        take: the take in base64, as described in ``integrations/web/src/page/take.ts``.
    """
    page, style, script = (_read(name).decode() for name in PAGE_FILES)
    notice = f"<!--\n{_read(_LICENCES).decode()}-->"
    data = f'<script id="take" type="text/plain">{take}</script>'
    # The page refers to each file once. The script contains no "</script", which a test checks.
    page = page.replace("<title>enliven</title>", f"<title>{html.escape(title)} · enliven</title>\n{notice}")
    page = page.replace(_STYLE_LINK, f"<style>\n{style}</style>")
    return page.replace(_SCRIPT_LINK, f"{data}\n<script>{script}</script>").encode()


def _read(name: str) -> bytes:
    return files("enliven.web_page").joinpath(name).read_bytes()
