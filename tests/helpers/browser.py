"""Drives headless Chromium by the DevTools protocol: opens pages, runs scripts and takes screenshots."""

from __future__ import annotations

import base64
import contextlib
import io
import json
import os
import signal
import subprocess
import time
import urllib.request
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image
from three_viewer import CHROMIUM, CHROMIUM_OPTIONS
from websockets.sync.client import connect

MISSING_REASON = "" if CHROMIUM else "Chromium is not installed"
"""The reason why no page can be opened; empty if everything is installed."""
_TIMEOUT_S = 180.0
"""Timeout of a condition or a command, seconds. Ten pages share one processor, which also renders in
software.
"""


class PageError(AssertionError):
    """A script of a page failed, or a condition did not become true in time."""


class Page:
    """One page (tab). Create it by :meth:`Browser.open`."""

    def __init__(self, address: str) -> None:
        self._stack = contextlib.ExitStack()
        self._socket = self._stack.enter_context(connect(address, max_size=None, open_timeout=_TIMEOUT_S))
        self._number = 0
        self.errors: list[str] = []
        self.call("Runtime.enable")
        self.call("Page.enable")

    def call(self, method: str, **parameters: Any) -> dict[str, Any]:
        """Calls a method of the protocol and returns its result."""
        self._number += 1
        self._socket.send(json.dumps({"id": self._number, "method": method, "params": parameters}))
        while True:
            message = json.loads(self._socket.recv(timeout=_TIMEOUT_S))
            if message.get("method") == "Runtime.exceptionThrown":
                self.errors.append(json.dumps(message["params"]["exceptionDetails"])[:2000])
            if message.get("id") == self._number:
                if "error" in message:
                    raise PageError(f"{method}: {message['error']}")
                return message["result"]

    def run(self, script: str) -> Any:
        """Returns the value of a JavaScript expression, which may be a promise."""
        result = self.call("Runtime.evaluate", expression=script, returnByValue=True, awaitPromise=True)
        if "exceptionDetails" in result:
            raise PageError(f"{script}: {json.dumps(result['exceptionDetails'])[:2000]}")
        return result["result"].get("value")

    def wait_for(self, condition: str, seconds: float = _TIMEOUT_S) -> None:
        """Waits until a JavaScript expression is true."""
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            with contextlib.suppress(PageError):
                if self.run(condition):
                    return
            time.sleep(0.05)
        raise PageError(f"not true in time: {condition}; errors of the page: {self.errors}")

    def resize(self, width: int, height: int, *, phone: bool = False) -> None:
        """Sets the size of the page. ``phone`` emulates touch, but not a phone's high pixel density, because
        software rendering would take minutes.
        """
        size = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": phone}
        self.call("Emulation.setDeviceMetricsOverride", **size)
        self.call("Emulation.setTouchEmulationEnabled", enabled=phone)

    def screenshot(self, path: Path | None = None) -> np.ndarray:
        """Returns (H, W, 3) uint8 pixels of the page, and writes them to a PNG."""
        data = base64.b64decode(self.call("Page.captureScreenshot", format="png")["data"])
        if path is not None:
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(data)
        return np.asarray(Image.open(io.BytesIO(data)).convert("RGB"))

    def close(self) -> None:
        """Closes the page."""
        with contextlib.suppress(Exception):
            self.call("Page.close")
        self._stack.close()


class Browser:
    """A headless Chromium. Use :func:`open_browser`."""

    def __init__(self, port: int) -> None:
        self._base = f"http://127.0.0.1:{port}"
        self._pages: list[Page] = []

    def open(self, address: str = "about:blank") -> Page:
        """Opens an empty page and then loads the address, so that errors of all scripts are reported."""
        request = urllib.request.Request(f"{self._base}/json/new?about:blank", method="PUT")
        with urllib.request.urlopen(request, timeout=_TIMEOUT_S) as response:
            page = Page(json.load(response)["webSocketDebuggerUrl"])
        # Otherwise Chromium hides all pages except one, and a hidden page pauses.
        page.call("Emulation.setFocusEmulationEnabled", enabled=True)
        self._pages.append(page)
        if address != "about:blank":
            page.call("Page.navigate", url=address)
        return page

    def close(self) -> None:
        """Closes all pages and ends Chromium."""
        for page in self._pages:
            page.close()


@contextlib.contextmanager
def open_browser(folder: Path, *options: str) -> Iterator[Browser]:
    """Yields a headless Chromium that keeps its files in ``folder``. Ends Chromium afterwards."""
    own = [CHROMIUM, *CHROMIUM_OPTIONS, f"--user-data-dir={folder}", "--remote-debugging-port=0", *options]
    process = subprocess.Popen(
        [*own, "about:blank"], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True
    )
    try:
        browser = Browser(_wait_for_port(folder / "DevToolsActivePort"))
        try:
            yield browser
        finally:
            browser.close()
    finally:
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
        process.wait()


def _wait_for_port(path: Path) -> int:
    """Returns the port that Chromium writes to a file when it is ready."""
    end = time.monotonic() + _TIMEOUT_S
    while time.monotonic() < end:
        with contextlib.suppress(OSError, ValueError, IndexError):
            return int(path.read_text().splitlines()[0])
        time.sleep(0.05)
    raise PageError("Chromium did not start in time")
