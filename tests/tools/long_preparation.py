#!/usr/bin/env python3
"""Prepares many photos with stymo-prep, and watches its memory, open files and temporary files.

Usage: long_preparation.py BIN FOLDER PHOTOS... [--count N] [--size N] [--threads N]

FOLDER/photos gets links to the photos in the folders PHOTOS, under the name of their folder and
their own, and mirrored copies of as many as are missing to N. Needs Pillow for those. Prints a
table and what stymo-prep says at the end, and exits with 1 if memory grows by more than 1 % after
the first tenth of the photos, if open files grow, or if a temporary file is left.
"""
import argparse
import os
import pathlib
import re
import subprocess
import sys
import threading
import time

from process_watch import Watch


def collect(folders: list[pathlib.Path], target: pathlib.Path, count: int) -> None:
    photos = [(f"{folder.name}_{path.relative_to(folder).with_suffix('')}".replace("/", "_"), path)
              for folder in folders
              for path in sorted(folder.rglob("*")) if path.suffix in (".jpg", ".jpeg", ".png")]
    target.mkdir(parents=True)
    for name, path in photos[:count]:
        os.symlink(path.resolve(), target / (name + path.suffix))
    if count > len(photos):
        from PIL import Image, ImageOps
        for i in range(count - len(photos)):
            name, path = photos[i % len(photos)]
            ImageOps.mirror(Image.open(path).convert("RGB")).save(
                target / f"mirrored{i // len(photos)}_{name}.jpg", quality=90)


class Progress(threading.Thread):
    """Reads the photos that are done off the tool's stderr."""

    def __init__(self, stream):
        super().__init__(daemon=True)
        self.stream, self.done, self.text = stream, 0, ""

    def run(self):
        for line in self.stream:
            found = re.match(r"Photos +\d+% (\d+)/", line)
            if found:
                self.done = int(found[1])
            else:
                self.text += line


def main() -> int:
    parser = argparse.ArgumentParser()
    parser.add_argument("bin", type=pathlib.Path)
    parser.add_argument("folder", type=pathlib.Path)
    parser.add_argument("photos", type=pathlib.Path, nargs="+")
    parser.add_argument("--count", type=int, default=10000)
    parser.add_argument("--size", type=int, default=64)
    parser.add_argument("--threads", type=int, default=os.cpu_count())
    options = parser.parse_args()
    photos, out = options.folder / "photos", options.folder / "out"
    if not photos.exists():
        collect(options.photos, photos, options.count)
    start = time.time()
    process = subprocess.Popen(
        [options.bin / "stymo-prep", "--photos", photos, "--out", out, "--size", str(options.size),
         "--no-overlay", "--threads", str(options.threads)],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    progress = Progress(process.stderr)
    progress.start()
    watch = Watch(process.pid, "photos", options.count)
    most_temporary = 0
    while process.poll() is None and watch.look(progress.done):
        most_temporary = max(most_temporary, sum(1 for _ in out.rglob(".*.part*")))
        time.sleep(5)
    result = process.stdout.read()
    progress.join()
    flat = watch.is_flat(options.count // 10)
    left = [str(path) for path in out.rglob("*.part*")]
    print(f"temporary files: at most {most_temporary} at once, {len(left)} left")
    print(f"{(time.time() - start) / 60:.1f} minutes, exit code {process.returncode}")
    refusals = re.findall(r": (no face[^;\n]*|cannot be [^(\n]*)", result + progress.text)
    print(result.splitlines()[0] if result else progress.text)
    for reason in sorted(set(refusals)):
        print(f"{refusals.count(reason)} x {reason}")
    return 1 if process.returncode != 0 or not flat or left else 0


if __name__ == "__main__":
    sys.exit(main())
