"""Drive a headless Chromium by its DevTools protocol: look at a live page as often as a test likes."""

from __future__ import annotations

import asyncio
import base64
import json
import shutil
import subprocess
import time
from pathlib import Path
from typing import Any

import pytest
import tornado.websocket

PATIENCE_S = 3600.0  # what waits in vain is ended; a busy machine is not


class Browser:
    """Own one browser with one page; `complaints` is what it has said on its console or logged as an error."""

    def __init__(self, folder: Path) -> None:
        found = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
        if found is None:
            pytest.skip("chromium is not installed")
        command = [
            found, "--headless", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage", "--no-first-run",
            "--disable-background-networking", "--hide-scrollbars", "--remote-debugging-port=0",
            f"--user-data-dir={folder / 'profile'}", "about:blank",
        ]  # fmt: skip
        self.complaints: list[str] = []
        self._process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        self._loop = asyncio.new_event_loop()
        self._number = 0
        self._socket = self._run(self._connect(folder / "profile" / "DevToolsActivePort"))
        for domain in ("Page", "Runtime", "Log"):
            self.call(f"{domain}.enable")

    def _run(self, work: Any) -> Any:
        return self._loop.run_until_complete(asyncio.wait_for(work, PATIENCE_S))

    async def _connect(self, told: Path) -> Any:
        until = time.monotonic() + PATIENCE_S
        while not (told.exists() and "\n" in told.read_text()):
            assert time.monotonic() < until and self._process.poll() is None, "the browser does not start"
            await asyncio.sleep(0.05)
        port = told.read_text().split()[0]
        client = tornado.httpclient.AsyncHTTPClient()
        pages = json.loads((await client.fetch(f"http://127.0.0.1:{port}/json")).body)
        address = next(p["webSocketDebuggerUrl"] for p in pages if p["type"] == "page")
        return await tornado.websocket.websocket_connect(address, max_message_size=1 << 26)

    def call(self, method: str, **parameters: Any) -> Any:
        """Call a method of the protocol."""
        return self._run(self._call(method, parameters))

    async def _call(self, method: str, parameters: dict[str, Any]) -> Any:
        self._number += 1
        number = self._number
        await self._socket.write_message(json.dumps({"id": number, "method": method, "params": parameters}))
        while True:
            text = await self._socket.read_message()
            assert text is not None, "the browser has gone"
            message = json.loads(text)
            if message.get("id") == number:
                assert "error" not in message, message
                return message["result"]
            self._hear(message.get("method"), message.get("params", {}))

    def _hear(self, event: str, told: dict[str, Any]) -> None:
        if event == "Runtime.exceptionThrown":
            self.complaints.append(str(told["exceptionDetails"].get("exception", {}).get("description")))
        elif event == "Runtime.consoleAPICalled" and told["type"] in ("error", "warning", "assert"):
            self.complaints.append(str([a.get("value") for a in told["args"]]))
        elif event == "Log.entryAdded" and told["entry"]["level"] in ("error", "warning"):
            self.complaints.append(f"{told['entry']['text']} {told['entry'].get('url', '')}")

    def evaluate(self, script: str) -> Any:
        """Return the value of an expression in the page."""
        done = self.call("Runtime.evaluate", expression=script, returnByValue=True, awaitPromise=True)
        assert "exceptionDetails" not in done, done["exceptionDetails"]
        return done["result"].get("value")

    def open(self, url: str, wide: int = 1400, high: int = 1500, dark: bool = False) -> None:
        """Go to a page."""
        self.look(wide, high, dark)
        self.call("Page.navigate", url="about:blank")
        self.wait("location.href === 'about:blank' && document.readyState === 'complete'")
        self.complaints.clear()  # of the page before, whose server has gone
        self.call("Page.navigate", url=url)
        self.wait(f"location.href === {json.dumps(url)} && document.readyState === 'complete'")

    def leave(self) -> list[str]:
        """Return what the page has complained of so far."""
        said, self.complaints = self.complaints, []
        return said

    def look(self, wide: int, high: int, dark: bool) -> None:
        """Give the page another size or scheme."""
        self.call("Emulation.setDeviceMetricsOverride", width=wide, height=high, deviceScaleFactor=1, mobile=False)
        scheme = {"name": "prefers-color-scheme", "value": "dark" if dark else "light"}
        self.call("Emulation.setEmulatedMedia", features=[scheme])

    def wait(self, script: str) -> Any:
        """Wait until an expression in the page is true; returns its value."""
        until = time.monotonic() + PATIENCE_S
        while not (value := self.evaluate(script)):
            assert time.monotonic() < until, (script, self.evaluate("document.body.innerText"), self.complaints)
            time.sleep(0.1)
        return value

    def picture(self, target: Path) -> Path:
        """Write what the page looks like, as PNG."""
        data = self.call("Page.captureScreenshot", format="png")["data"]
        target.write_bytes(base64.b64decode(data))
        return target

    def close(self) -> None:
        """End the browser."""
        self._socket.close()
        self._process.terminate()
        self._process.wait(10.0)
        self._loop.close()
