"""A page in a headless browser, by the DevTools protocol; tests skip where there is no Chromium."""

import json
import os
import shutil
import subprocess
from base64 import b64decode
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import count
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import pytest

NAMES = ("chromium", "chromium-browser", "google-chrome", "chromium-headless-shell")
BROWSER = next(filter(None, map(shutil.which, NAMES)), None)
needs_browser = pytest.mark.skipif(BROWSER is None, reason="no Chromium is installed")
OPTIONS = (
    "--headless",
    "--no-sandbox",
    "--hide-scrollbars",
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--remote-debugging-pipe",
)


class Browser:
    """One page of a headless Chromium.

    console: what the page wrote there, errors and warnings included; requests: every address that
    it asked for, its own first. To be used in a `with`.
    """

    def __init__(self, folder: Path, width: int, height: int, dark: bool) -> None:
        assert BROWSER is not None
        theirs_in, self._to = os.pipe()
        own, theirs_out = os.pipe()
        self._from = os.fdopen(own, "rb")
        self._process = subprocess.Popen(
            ["bash", "-c", f'exec "$@" 3<&{theirs_in} 4>&{theirs_out}', "bash", BROWSER, *OPTIONS,
             f"--user-data-dir={folder / 'browser'}", "about:blank"],
            pass_fds=(theirs_in, theirs_out),
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )  # fmt: skip
        os.close(theirs_in)
        os.close(theirs_out)
        self._number, self._session = count(1), ""
        self.console: list[str] = []
        self.requests: list[str] = []
        target = self.call("Target.createTarget", url="about:blank")["targetId"]
        attached = self.call("Target.attachToTarget", targetId=target, flatten=True)
        self._session = attached["sessionId"]
        for domain in ("Page", "Runtime", "Log", "Network"):
            self.call(f"{domain}.enable")
        scheme = {"name": "prefers-color-scheme", "value": "dark" if dark else "light"}
        self.call("Emulation.setEmulatedMedia", features=[scheme])
        self.call(
            "Emulation.setDeviceMetricsOverride",
            width=width,
            height=height,
            deviceScaleFactor=1,
            mobile=width < 600,
        )

    def call(self, method: str, **parameters: Any) -> Any:
        """The answer to a method of the protocol; events on the way are kept."""
        number = next(self._number)
        message = {"id": number, "method": method, "params": parameters}
        if self._session:
            message["sessionId"] = self._session
        os.write(self._to, json.dumps(message).encode() + b"\0")
        while (answer := self._read()).get("id") != number:
            self._keep(answer)
        assert "error" not in answer, answer["error"]
        return answer["result"]

    def open(self, path: Path) -> None:
        """Opens a file, and waits until it has loaded."""
        self.call("Page.navigate", url=path.absolute().as_uri())
        self.run("new Promise(d => document.readyState === 'complete' ? d() : onload = d)")

    def run(self, script: str) -> Any:
        """What an expression comes to, as JSON; a promise is waited for."""
        answer = self.call(
            "Runtime.evaluate", expression=script, awaitPromise=True, returnByValue=True
        )
        assert "exceptionDetails" not in answer, answer["exceptionDetails"]
        return answer["result"].get("value")

    def screenshot(self, path: Path) -> None:
        """The page as it is seen, as PNG."""
        path.write_bytes(b64decode(self.call("Page.captureScreenshot")["data"]))

    def pdf(self) -> bytes:
        """The page as it is printed on A4."""
        inches = {"paperWidth": 8.27, "paperHeight": 11.69}
        return b64decode(self.call("Page.printToPDF", **inches)["data"])

    def _read(self) -> Any:
        message = b""
        while not message.endswith(b"\0"):
            part = self._from.read(1)
            assert part, "the browser has ended"
            message += part
        return json.loads(message[:-1])

    def _keep(self, event: Any) -> None:
        inside = event.get("params", {})
        match event.get("method"):
            case "Runtime.consoleAPICalled":
                self.console.append(" ".join(str(each.get("value")) for each in inside["args"]))
            case "Runtime.exceptionThrown":
                self.console.append(json.dumps(inside["exceptionDetails"]))
            case "Log.entryAdded":
                self.console.append(inside["entry"]["text"])
            case "Network.requestWillBeSent":
                self.requests.append(inside["request"]["url"])

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._process.terminate()
        self._process.wait()
        os.close(self._to)
        self._from.close()


@contextmanager
def opened(
    page: str, folder: Path, width: int = 1000, height: int = 800, dark: bool = False
) -> Iterator[Browser]:
    """An HTML text opened in a browser window of so many pixels."""
    path = folder / "page.html"
    path.write_text(page, encoding="utf-8")
    with Browser(folder, width, height, dark) as browser:
        browser.open(path)
        yield browser
