"""A headless Chromium driven over a pair of pipes: enough to open pages, press keys, and ask what is seen."""

from __future__ import annotations

import base64
import json
import os
import shutil
import subprocess
import tempfile
from pathlib import Path
from types import TracebackType
from typing import Any

PROGRAM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
DESKTOP = (1280, 800, False)
PHONE = (390, 844, True)
TALLEST = 16000
"""Pixels of a picture: Chromium refuses larger ones."""


class Chromium:
    """One browser with one tab; `with Chromium() as browser`. Messages are JSON, each ended by a zero byte."""

    def __init__(self) -> None:
        assert PROGRAM is not None
        self.home = tempfile.mkdtemp(prefix="partita-chromium-")
        read_theirs, self.write = os.pipe()
        self.read, write_theirs = os.pipe()

        def place() -> None:
            # The browser reads from descriptor 3 and writes to 4; high copies first, so that neither is overwritten.
            low = os.dup(read_theirs), os.dup(write_theirs)
            high = [os.dup2(fd, 60 + i) for i, fd in enumerate(low)]
            os.dup2(high[0], 3, inheritable=True)
            os.dup2(high[1], 4, inheritable=True)

        self.process = subprocess.Popen(
            [PROGRAM, "--headless", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage", "--hide-scrollbars",
             "--no-first-run", f"--user-data-dir={self.home}", "--remote-debugging-pipe", "about:blank"],
            preexec_fn=place, close_fds=False, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
        )  # fmt: skip
        os.close(read_theirs)
        os.close(write_theirs)
        self.rest, self.count, self.session = b"", 0, ""
        self.reported: list[str] = []
        self.loads = 0
        target = next(t for t in self.ask("Target.getTargets")["targetInfos"] if t["type"] == "page")
        self.session = self.ask("Target.attachToTarget", targetId=target["targetId"], flatten=True)["sessionId"]
        for domain in ("Page", "Runtime", "Log"):
            self.ask(f"{domain}.enable")

    def __enter__(self) -> Chromium:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self.process.terminate()
        self.process.wait(20)
        os.close(self.read)
        os.close(self.write)
        shutil.rmtree(self.home, ignore_errors=True)

    def _next(self) -> dict[str, Any]:
        while b"\0" not in self.rest:
            more = os.read(self.read, 1 << 16)
            if not more:
                raise RuntimeError("Chromium ended")
            self.rest += more
        text, self.rest = self.rest.split(b"\0", 1)
        message: dict[str, Any] = json.loads(text)
        kind, what = message.get("method", ""), message.get("params", {})
        if kind == "Page.loadEventFired":
            self.loads += 1
        elif kind == "Runtime.exceptionThrown":
            self.reported.append(json.dumps(what["exceptionDetails"])[:600])
        elif kind == "Runtime.consoleAPICalled" and what["type"] in ("error", "warning", "assert"):
            self.reported.append(json.dumps(what["args"])[:600])
        elif kind == "Log.entryAdded" and what["entry"]["level"] in ("error", "warning"):
            self.reported.append(what["entry"]["text"])
        return message

    def ask(self, method: str, **params: Any) -> dict[str, Any]:
        """Send a command and return its answer; what comes in between is kept in `reported` where it is an error."""
        self.count += 1
        message: dict[str, Any] = {"id": self.count, "method": method, "params": params}
        if self.session:
            message["sessionId"] = self.session
        data = json.dumps(message).encode() + b"\0"
        while data:
            data = data[os.write(self.write, data) :]
        while True:
            answer = self._next()
            if answer.get("id") == self.count:
                if "error" in answer:
                    raise RuntimeError(f"{method}: {answer['error']}")
                found: dict[str, Any] = answer["result"]
                return found

    def open(
        self, path: Path | str, screen: tuple[int, int, bool] = DESKTOP, scheme: str = "light", at: str = ""
    ) -> None:
        """Open a page of this disk, or an address, on a screen (width, height, touch), with the colour scheme a person
        prefers."""
        width, height, touch = screen
        self.ask(
            "Emulation.setDeviceMetricsOverride",
            width=width, height=height, deviceScaleFactor=2 if touch else 1, mobile=touch,
        )  # fmt: skip
        self.ask("Emulation.setTouchEmulationEnabled", enabled=touch)
        self.ask("Emulation.setEmulatedMedia", features=[{"name": "prefers-color-scheme", "value": scheme}])
        self.reported = []
        self.load("about:blank")  # else a change behind # alone would not load anew
        self.load((path.resolve().as_uri() if isinstance(path, Path) else path) + at)
        self.rest_a_frame()

    def load(self, address: str) -> None:
        """Go there, and wait until it is loaded: that may be reported before the answer to the command."""
        self.loads = 0
        self.ask("Page.navigate", url=address)
        while self.loads == 0:
            self._next()

    def rest_a_frame(self) -> None:
        self.value("new Promise(r => requestAnimationFrame(() => requestAnimationFrame(() => r(0))))")

    def value(self, script: str) -> Any:
        """What a line of JavaScript gives."""
        reported = self.ask("Runtime.evaluate", expression=script, returnByValue=True, awaitPromise=True)
        if "exceptionDetails" in reported:
            raise RuntimeError(json.dumps(reported["exceptionDetails"])[:800])
        return reported["result"].get("value")

    def press(self, key: str, code: str = "", shift: bool = False) -> None:
        """Press a key: a character, or a name such as Tab, ArrowLeft."""
        about: dict[str, Any] = {"key": key, "code": code or key, "modifiers": 8 if shift else 0}
        number = {"Tab": 9, "ArrowLeft": 37, "ArrowUp": 38, "ArrowRight": 39, "ArrowDown": 40, "Enter": 13}.get(key)
        if number:
            about["windowsVirtualKeyCode"] = number
        elif len(key) == 1:
            about["text"] = key
        self.ask("Input.dispatchKeyEvent", type="keyDown", **about)
        self.ask("Input.dispatchKeyEvent", type="keyUp", **about)

    def mouse(self, kind: str, at: tuple[float, float], held: bool, button: str = "left") -> None:
        """One event of the mouse: "mouseMoved", "mousePressed" or "mouseReleased", with a button held or not."""
        self.ask(
            "Input.dispatchMouseEvent",
            type=kind, x=at[0], y=at[1], button=button if held or kind == "mouseReleased" else "none",
            buttons=held * {"left": 1, "right": 2}[button], clickCount=1,
        )  # fmt: skip

    def drag(self, *points: tuple[float, float], button: str = "left") -> None:
        """Press the mouse at the first pixel, move it through the others, release it at the last; one is a click."""
        self.mouse("mouseMoved", points[0], False)
        self.mouse("mousePressed", points[0], True, button)
        for at in points[1:]:
            self.mouse("mouseMoved", at, True, button)
        self.mouse("mouseReleased", points[-1], False, button)

    def touch(self, *steps: list[tuple[float, float]]) -> None:
        """Put fingers on the screen, move them through the steps (pixels of each finger), and lift them; those that a
        step has not are lifted there, the last first."""
        down = 0
        for fingers in steps:
            points = [{"x": x, "y": y, "id": i} for i, (x, y) in enumerate(fingers)]
            kind = "touchStart" if len(fingers) > down else "touchEnd" if len(fingers) < down else "touchMove"
            self.ask("Input.dispatchTouchEvent", type=kind, touchPoints=points)
            down = len(fingers)
        self.ask("Input.dispatchTouchEvent", type="touchEnd", touchPoints=[])

    def picture(self, path: Path, whole: bool = False) -> None:
        """Save what is seen as a PNG; `whole` the page below too, as far as a picture can hold it."""
        box: dict[str, Any] = {}
        if whole:
            size = self.ask("Page.getLayoutMetrics")["cssContentSize"]
            tall = min(size["height"], TALLEST / self.value("window.devicePixelRatio"))
            box = {"clip": {"x": 0, "y": 0, "width": size["width"], "height": tall, "scale": 1}}
        data = self.ask("Page.captureScreenshot", format="png", captureBeyondViewport=whole, **box)["data"]
        path.write_bytes(base64.b64decode(data))
