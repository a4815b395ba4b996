#!/usr/bin/env python3
"""A picture of what the Rerun viewer shows of a file at one moment, without a screen.

  picture.py FILE.rrd|FILE.mcap OUT.png SECONDS [WIDTHxHEIGHT]

Needs `pip install rerun-sdk==0.36.3 pillow` and a Vulkan driver; software will do (Debian: mesa-vulkan-drivers).
"""
import json
import os
import socket
import subprocess
import sys
import tempfile
import time

import rerun_cli
from PIL import Image

RERUN = os.path.join(os.path.dirname(rerun_cli.__file__), "rerun")


class Control:
    """`rerun viewer-mcp`: JSON-RPC, a line each way."""

    def __init__(self, environment):
        pipe = subprocess.PIPE
        self.process = subprocess.Popen([RERUN, "viewer-mcp"], stdin=pipe, stdout=pipe, stderr=subprocess.DEVNULL, env=environment)
        self.number = 0
        client = {"name": "picture", "version": "1"}
        self.call("initialize", {"protocolVersion": "2024-11-05", "capabilities": {}, "clientInfo": client})
        self.write({"jsonrpc": "2.0", "method": "notifications/initialized"})

    def write(self, message):
        self.process.stdin.write(json.dumps(message).encode() + b"\n")
        self.process.stdin.flush()

    def call(self, method, parameters):
        self.number += 1
        self.write({"jsonrpc": "2.0", "id": self.number, "method": method, "params": parameters})
        while True:
            answer = json.loads(self.process.stdout.readline())
            if answer.get("id") == self.number:
                return answer["result"]

    def tool(self, name, **arguments):
        result = self.call("tools/call", {"name": name, "arguments": arguments})
        text = "\n".join(part["text"] for part in result.get("content", []) if part.get("type") == "text")
        if result.get("isError"):
            raise RuntimeError(f"{name}: {text}")
        try:
            return json.loads(text)
        except ValueError:
            return text


def ranges(control):
    state = control.tool("viewer_state")
    for recording in state.get("recordings", []):
        if recording["store_id"] == state.get("active_store_id") and recording.get("timelines"):
            return {t["timeline"]: (t["min"], t["max"]) for t in recording["timelines"]}
    return {}


def main():
    if len(sys.argv) not in (4, 5):
        sys.exit(__doc__)
    file, out, seconds = sys.argv[1], os.path.abspath(sys.argv[2]), float(sys.argv[3])
    size = sys.argv[4] if len(sys.argv) == 5 else "1600x900"
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = str(free.getsockname()[1])
    with tempfile.TemporaryDirectory() as home:
        environment = dict(os.environ, RUST_LOG="error", WGPU_BACKEND="vulkan", XDG_CONFIG_HOME=home, XDG_DATA_HOME=home, XDG_CACHE_HOME=home)
        subprocess.run([RERUN, "analytics", "disable"], env=environment, capture_output=True)
        folder, name = os.path.split(os.path.abspath(file))
        viewer = subprocess.Popen(
            [RERUN, name, "--headless", "--hide-welcome-screen", "--bind", "127.0.0.1", "--port", port, "--window-size", size],
            cwd=folder, env=environment, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        control = None
        try:
            deadline = time.monotonic() + 120
            control = Control(environment)
            while True:
                try:
                    control.tool("connect", endpoint=f"http://127.0.0.1:{port}")
                    break
                except RuntimeError:
                    if time.monotonic() > deadline or viewer.poll() is not None:
                        raise
                    time.sleep(0.3)
            seen, since = {}, time.monotonic()
            while time.monotonic() - since < 2.5 or not seen:
                if time.monotonic() > deadline:
                    raise RuntimeError(f"{file}: was not loaded within two minutes")
                now = ranges(control)
                if now != seen:
                    seen, since = now, time.monotonic()
                time.sleep(0.2)
            timeline = "time" if "time" in seen else "message_log_time"  # an .mcap that the viewer opens by itself
            control.tool("set_time", timeline=timeline, time=seen[timeline][0] + round(seconds * 1e9))
            for _ in range(3):
                control.tool("wait_for", min_steps=3, timeout_secs=5)
            picture = os.path.join(home, "picture.png")
            while not os.path.exists(picture):
                try:
                    control.tool("screenshot", save_path=picture, pixels_per_point=1.0)
                except RuntimeError:  # a busy machine without a graphics card may take its time
                    if time.monotonic() > deadline:
                        raise
            # 256 colours are enough for such pictures and make them small; thin lines keep theirs by this choice of colours.
            few = Image.open(picture).convert("RGB").quantize(256, kmeans=4, dither=Image.Dither.NONE)
            few.save(out, optimize=True)
        finally:
            viewer.terminate()
            if control:
                control.process.terminate()


if __name__ == "__main__":
    main()
