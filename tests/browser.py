"""A page in headless Chromium over the DevTools protocol; tests skip without Chromium."""

import atexit
import json
import os
import shutil
import subprocess
from base64 import b64decode
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from itertools import count
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import pytest

NAMES = ("chromium", "chromium-browser", "google-chrome", "chromium-headless-shell")
BROWSER = next(filter(None, map(shutil.which, NAMES)), None)
needs_browser = pytest.mark.skipif(BROWSER is None, reason="no Chromium is installed")
OPTIONS = ("--headless", "--no-sandbox", "--hide-scrollbars", "--remote-debugging-pipe")
# Software WebGL; without it all other drawing takes half the time.
WITH_WEBGL = ("--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader")
WITHOUT = ("--disable-gpu",)


class Chromium:
    """A headless Chromium that is controlled over two pipes until Python ends."""

    def __init__(self, webgl: bool) -> None:
        assert BROWSER is not None
        folder = TemporaryDirectory(ignore_cleanup_errors=True)
        options = *OPTIONS, *(WITH_WEBGL if webgl else WITHOUT), f"--user-data-dir={folder.name}"
        theirs_in, self._to = os.pipe()
        self._answers, theirs_out = os.pipe()
        process = subprocess.Popen(
            ["bash", "-c", f'exec "$@" 3<&{theirs_in} 4>&{theirs_out}', "bash", BROWSER, *options,
             "about:blank"],
            pass_fds=(theirs_in, theirs_out),
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )  # fmt: skip
        os.close(theirs_in)
        os.close(theirs_out)
        atexit.register(folder.cleanup)
        atexit.register(process.wait)
        atexit.register(process.terminate)  # registered last, called first
        self._unread = b""
        self.numbers = count(1)

    def send(self, message: Any) -> None:
        os.write(self._to, json.dumps(message).encode() + b"\0")

    def read(self) -> Any:
        # Messages may have megabytes: read in parts, and keep the rest after the end.
        while b"\0" not in self._unread:
            part = os.read(self._answers, 1 << 20)
            assert part, "the browser has ended"
            self._unread += part
        message, _, self._unread = self._unread.partition(b"\0")
        return json.loads(message)


_started = cache(Chromium)


class Browser:
    """A page in a Chromium, without the storage of other pages.

    console: all that was logged there; requests: every requested address, the page's first.
    """

    def __init__(self, chromium: Chromium) -> None:
        self._chromium, self._session = chromium, ""
        self.console: list[str] = []
        self.requests: list[str] = []
        self._context = self.call("Target.createBrowserContext")["browserContextId"]
        target = self.call(
            "Target.createTarget", url="about:blank", browserContextId=self._context
        )["targetId"]
        attached = self.call("Target.attachToTarget", targetId=target, flatten=True)
        self._session = attached["sessionId"]
        for domain in ("Page", "Runtime", "Log", "Network"):
            self.call(f"{domain}.enable")

    def call(self, method: str, **parameters: Any) -> Any:
        """Return the answer to a method of the protocol; record events that come before it."""
        number = next(self._chromium.numbers)
        message = {"id": number, "method": method, "params": parameters}
        if self._session:
            message["sessionId"] = self._session
        self._chromium.send(message)
        while (answer := self._chromium.read()).get("id") != number:
            if answer.get("sessionId") == self._session:
                self._keep(answer)
        assert "error" not in answer, answer["error"]
        return answer["result"]

    def run(self, script: str) -> Any:
        """Return an expression's value as JSON; wait for a promise."""
        answer = self.call(
            "Runtime.evaluate", expression=script, awaitPromise=True, returnByValue=True
        )
        assert "exceptionDetails" not in answer, answer["exceptionDetails"]
        return answer["result"].get("value")

    def visit(self, address: str) -> None:
        self.call("Page.navigate", url=address)
        self.run("new Promise(d => document.readyState === 'complete' ? d() : onload = d)")

    def size(self, width: int, height: int, dark: bool = False, media: str = "") -> None:
        """Set the window to width x height pixels; `media="print"` shows the printed page."""
        scheme = {"name": "prefers-color-scheme", "value": "dark" if dark else "light"}
        self.call("Emulation.setEmulatedMedia", media=media, features=[scheme])
        size = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": width < 600}
        self.call("Emulation.setDeviceMetricsOverride", **size)

    def pdf(self) -> bytes:
        inches = {"paperWidth": 8.27, "paperHeight": 11.69}
        return b64decode(self.call("Page.printToPDF", **inches)["data"])

    def close(self) -> None:
        self._session = ""
        self.call("Target.disposeBrowserContext", browserContextId=self._context)

    def _keep(self, event: Any) -> None:
        params = event.get("params", {})
        match event.get("method"):
            case "Runtime.consoleAPICalled":
                self.console.append(" ".join(str(arg.get("value")) for arg in params["args"]))
            case "Runtime.exceptionThrown":
                self.console.append(json.dumps(params["exceptionDetails"]))
            case "Log.entryAdded":
                self.console.append(params["entry"]["text"])
            case "Network.requestWillBeSent":
                self.requests.append(params["request"]["url"])


@contextmanager
def opened(
    page: str,
    folder: Path,
    width: int = 1000,
    height: int = 800,
    dark: bool = False,
    webgl: bool = True,
) -> Iterator[Browser]:
    """Open an HTML text in a browser window of width x height pixels."""
    path = folder / "page.html"
    path.write_text(page, encoding="utf-8")
    browser = Browser(_started(webgl))
    try:
        browser.size(width, height, dark)
        browser.visit(path.absolute().as_uri())
        yield browser
    finally:
        browser.close()
