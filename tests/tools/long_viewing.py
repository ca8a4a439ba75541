#!/usr/bin/env python3
"""Asks stymo-view for many frames through HTTP, with another camera and other codes each time, and
watches its memory and open files.

Usage: long_viewing.py BIN [--frames N] [--threads N] [--quality thumbnail|moving] [--model FILE]

A thumbnail has 64 pixels. A new face is drawn for each 1,000 frames and removed after them. Prints
a table, and exits with 1 if memory grows by more than 1 % after the first tenth of the frames, if
open files grow, or if the last frame, of the first frame's face and camera, differs in a bit.
"""
import argparse
import http.client
import json
import os
import pathlib
import random
import re
import subprocess
import sys
import time

from process_watch import Watch


class Client:
    """One session of the viewer."""

    def __init__(self, port: int):
        self.connection = http.client.HTTPConnection("127.0.0.1", port)
        self.session = ""
        opened = json.loads(self.ask("session"))
        self.session = opened["session"]
        self.faces = [face["face"] for face in opened["faces"]]

    def ask(self, path: str, body: dict | None = None) -> bytes:
        while True:
            self.connection.request("POST", "/api/" + path, json.dumps(body) if body else "{}",
                                    {"X-Stymo-Session": self.session})
            answer = self.connection.getresponse()
            text = answer.read()
            if answer.status == 200:
                return text
            if answer.status != 429:  # too many requests a second
                raise RuntimeError(f"{path}: {answer.status} {text.decode()}")
            time.sleep(0.05)

    def frame(self, face: str, draws: random.Random, quality: str) -> bytes:
        camera = {"yaw": draws.uniform(-40, 40), "pitch": draws.uniform(-20, 20),
                  "roll": draws.uniform(-10, 10), "distance": draws.uniform(0.9, 1.2)}
        sliders = {group: [draws.uniform(-1, 1) for _ in range(3)]
                   for group in ("id", "expr", "tex", "light")}
        return self.ask("frame", {"face": face, "camera": camera, "sliders": sliders,
                                  "quality": quality})


def port_of(process: subprocess.Popen) -> int:
    text = ""
    for line in process.stderr:
        text += line
        found = re.match(r"Open http://[^:]*:(\d+)", line)
        if found:
            return int(found[1])
    raise RuntimeError("stymo-view has not started: " + text)


def main() -> int:
    parser = argparse.ArgumentParser()
    parser.add_argument("bin", type=pathlib.Path)
    parser.add_argument("--frames", type=int, default=100000)
    parser.add_argument("--threads", type=int, default=os.cpu_count())
    parser.add_argument("--quality", choices=("thumbnail", "moving"), default="thumbnail")
    parser.add_argument("--model", type=pathlib.Path)
    options = parser.parse_args()
    process = subprocess.Popen(
        [options.bin / "stymo-view", "--port", "0", "--threads", str(options.threads),
         *(["--model", options.model] if options.model else [])],
        stderr=subprocess.PIPE, text=True)
    try:
        client = Client(port_of(process))
        first_face, start = client.faces[0], time.time()
        first = client.frame(first_face, random.Random(0), options.quality)
        watch = Watch(process.pid, "frames", options.frames)
        face = None
        for number in range(2, options.frames):
            if number % 1000 == 2:
                if face:
                    client.ask("remove?face=" + face)
                face = json.loads(client.ask("face", {"seed": number}))["face"]
            client.frame(face, random.Random(number), options.quality)
            if number % 100 == 0:
                watch.look(number)
        last = client.frame(first_face, random.Random(0), options.quality)
        seconds = time.time() - start
        flat = watch.is_flat(options.frames // 10)
        print(f"{options.frames / seconds:.0f} frames a second; the first view again has "
              f"{'the same bits' if first == last else 'OTHER BITS'}")
        return 0 if flat and first == last else 1
    finally:
        process.terminate()


if __name__ == "__main__":
    sys.exit(main())
