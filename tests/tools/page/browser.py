# SPDX-License-Identifier: GPL-3.0-or-later
"""A headless Chromium driven over the WebDriver protocol by chromedriver, with Python's own library alone."""
import base64
import json
import os
import shutil
import struct
import subprocess
import tempfile
import time
import urllib.error
import urllib.request
import zlib

FLAGS = ["--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-background-networking",
         "--disable-component-update", "--disable-sync", "--disable-dev-shm-usage", "--hide-scrollbars",
         # No graphics card: WebGL is drawn by the processor.
         "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--force-device-scale-factor=1"]


def absent():
    """What is missing, as a sentence, or None."""
    for name in ("chromium", "chromedriver"):
        if not shutil.which(name):
            return f"{name} is not installed (apt-get install chromium chromium-driver)"
    return None


class Image:
    """8-bit pixels of a PNG whose rows are differences to the rows above: at(x, y) is (red, green, blue)."""

    def __init__(self, png):
        assert png[:8] == b"\x89PNG\r\n\x1a\n"
        at, data = 8, b""
        while at < len(png):
            size, kind = struct.unpack(">I4s", png[at:at + 8])
            body = png[at + 8:at + 8 + size]
            if kind == b"IHDR":
                self.width, self.height, depth, colour, _, _, interlace = struct.unpack(">IIBBBBB", body)
                assert depth == 8 and colour in (2, 6) and interlace == 0
                self.channels = 3 if colour == 2 else 4
            elif kind == b"IDAT":
                data += body
            at += size + 12
        raw, stride = zlib.decompress(data), self.width * self.channels
        assert set(raw[::stride + 1]) == {2}, "the PNG has other filters"
        self.rows, above = [], bytes(stride)
        for y in range(self.height):
            above = bytes([a + b & 255 for a, b in zip(above, raw[y * (stride + 1) + 1:(y + 1) * (stride + 1)])])
            self.rows.append(above)

    def at(self, x, y):
        return tuple(self.rows[y][x * self.channels:x * self.channels + 3])


class Browser:
    def __init__(self, width=1000, height=700):
        self.folder = tempfile.mkdtemp()
        self.driver = subprocess.Popen(["chromedriver", "--port=0"], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
        for line in self.driver.stdout:
            if "started successfully on port" in line:
                self.root = "http://127.0.0.1:" + line.strip().rstrip(".").split()[-1]
                break
        else:
            raise RuntimeError("chromedriver did not start")
        flags = FLAGS + [f"--user-data-dir={self.folder}", f"--window-size={width},{height}"]
        answer = self.call("POST", "/session", {"capabilities": {"alwaysMatch": {
            "browserName": "chrome", "goog:chromeOptions": {"binary": shutil.which("chromium"), "args": flags},
            "goog:loggingPrefs": {"browser": "ALL"}}}})
        self.session = "/session/" + answer["sessionId"]
        self.resize(width, height)

    def call(self, method, path, body=None):
        request = urllib.request.Request(self.root + path, method=method, data=None if body is None else json.dumps(body).encode(),
                                         headers={"Content-Type": "application/json"})
        opener = urllib.request.build_opener(urllib.request.ProxyHandler({}))
        try:
            return json.load(opener.open(request, timeout=120))["value"]
        except urllib.error.HTTPError as e:
            raise RuntimeError(json.load(e)["value"]["message"]) from None

    def send(self, path, body):
        return self.call("POST", f"{self.session}/{path}", body)

    def command(self, name, **params):
        return self.send("goog/cdp/execute", {"cmd": name, "params": params})

    def resize(self, width, height):  # of the page: Chromium's window is taller
        self.command("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=False)

    def prefer(self, scheme):
        """What the system says about colours: dark or light."""
        self.command("Emulation.setEmulatedMedia", features=[{"name": "prefers-color-scheme", "value": scheme}])

    def open(self, path):
        self.send("url", {"url": "file://" + os.path.abspath(path)})

    def run(self, script, *args):
        return self.send("execute/sync", {"script": script, "args": list(args)})

    def wait(self, script, seconds=60):
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            value = self.run("return " + script)
            if value:
                return value
            time.sleep(0.02)
        raise AssertionError(f"waited {seconds} s for: {script}")

    def text(self, selector):
        return self.run("const e = document.querySelector(arguments[0]); return e && !e.closest('[hidden]') ? e.textContent : null", selector)

    def pointer(self, actions, kind="mouse"):
        self.send("actions", {"actions": [{"type": "pointer", "id": kind, "parameters": {"pointerType": kind}, "actions": actions}]})

    def click(self, x, y, kind="mouse"):
        self.pointer([{"type": "pointerMove", "x": round(x), "y": round(y), "duration": 0}, {"type": "pointerDown", "button": 0},
                      {"type": "pointerUp", "button": 0}], kind)

    def drag(self, points, button=0, kind="mouse"):
        at = lambda p, ms: {"type": "pointerMove", "x": round(p[0]), "y": round(p[1]), "duration": ms}
        self.pointer([at(points[0], 0), {"type": "pointerDown", "button": button}] + [at(p, 30) for p in points[1:]] +
                     [{"type": "pointerUp", "button": button}], kind)

    def keys(self, text):
        self.send("actions", {"actions": [{"type": "key", "id": "keys", "actions": [
            {"type": kind, "value": key} for key in text for kind in ("keyDown", "keyUp")]}]})

    def screenshot(self):
        # Optimized for speed, a PNG has one simple filter. Others cost Python a second a picture.
        png = base64.b64decode(self.command("Page.captureScreenshot", optimizeForSpeed=True)["data"])
        if os.environ.get("PADDER_SCREENSHOTS"):  # a folder to look at them in
            name = f"{time.monotonic_ns()}.png"
            with open(os.path.join(os.environ["PADDER_SCREENSHOTS"], name), "wb") as f:
                f.write(png)
        return Image(png)

    def log(self):
        """Messages of the console since the last call, but for the driver's talk of how fast it is."""
        return [m["message"] for m in self.send("se/log", {"type": "browser"}) if "GL Driver Message" not in m["message"]]

    def cpu(self):
        """Processor seconds that the browser's processes have used so far, by what they are."""
        def stat(pid):
            with open(f"/proc/{pid}/stat") as f:
                return f.read().rsplit(")", 1)[1].split()
        spent, family = {}, {self.driver.pid}
        pids = sorted(int(p) for p in os.listdir("/proc") if p.isdigit())
        for pid in pids:  # a child has a larger number than its parent
            try:
                fields = stat(pid)
                if int(fields[1]) not in family:
                    continue
                family.add(pid)
                with open(f"/proc/{pid}/cmdline") as f:
                    words = f.read().replace("\0", " ").split()
                kind = next((w[7:] for w in words if w.startswith("--type=")), "browser")
                spent[kind] = spent.get(kind, 0) + (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
            except (OSError, IndexError):
                pass  # it has just ended
        return spent

    def close(self):
        try:
            self.call("DELETE", self.session)
        finally:
            self.driver.terminate()
            self.driver.wait(30)
            shutil.rmtree(self.folder, ignore_errors=True)
