#!/usr/bin/env python3
"""Trains demo-64 for many steps twice at once: in one piece, and stopped and resumed several times.
Watches memory and open files of the first run, and compares what both end with.

Usage: long_run.py BIN FOLDER [--steps N] [--stops N] [--threads N] [--set KEY=VALUE]...

Prints a table of the first run and exits with 1 if its resident memory grows by more than 1 % after
step 1,000, if open files grow, or if the runs differ in a weight or in a loss that they report, or
if a loss differs from the one that was reported before the run was resumed from a checkpoint.
"""
import argparse
import json
import os
import pathlib
import random
import signal
import subprocess
import sys
import threading
import time

from process_watch import Watch

root = pathlib.Path(__file__).resolve().parents[2]


def last_step(run: pathlib.Path) -> int:
    try:
        lines = (run / "stats.jsonl").read_text().splitlines()
        return json.loads(lines[-1])["step"] if lines else 0
    except (FileNotFoundError, json.JSONDecodeError):
        return 0


def losses(run: pathlib.Path) -> dict[int, dict]:
    """What the statistics of a run say of each step that they name, without times."""
    lines = [json.loads(line) for line in (run / "stats.jsonl").read_text().splitlines()]
    return {line["step"]: {key: value for key, value in line.items() if "_per_second" not in key}
            for line in lines}


def without_resumed(lines: dict[int, dict], resumed: list[int]) -> dict[int, dict]:
    """Leaves out the lines in whose steps the run was resumed: they are means over the steps after
    it."""
    tick = min(lines)
    return {step: line for step, line in lines.items()
            if not any(0 < step - at < tick for at in resumed)}


def stopped_run(train, run: pathlib.Path, stops: list[int], draws: random.Random):
    """Trains with stops. Returns whether it ended well, the steps that it was resumed at, and pairs
    of the losses that were reported before and after a stop for the same step."""
    process = train(run.name)
    resumed, twice = [], []
    for stop in stops:
        while process.poll() is None and last_step(run) < stop:
            time.sleep(0.2)
        process.send_signal(signal.SIGKILL if draws.random() < 0.5 else signal.SIGTERM)
        process.wait()
        latest = run / "latest"
        resumed.append(int(latest.read_text()) if latest.exists() else 0)
        twice.append(losses(run))
        process = train(run.name, *(["--resume", "latest"] if latest.exists() else []))
    ended = process.wait() == 0
    last = losses(run)
    pairs = [(line, last[step]) for before, at in zip(twice, resumed)
             for step, line in without_resumed(before, resumed).items()
             if step > at and step in without_resumed(last, resumed)]
    return ended, resumed, pairs


def main() -> int:
    parser = argparse.ArgumentParser()
    parser.add_argument("bin", type=pathlib.Path)
    parser.add_argument("folder", type=pathlib.Path)
    parser.add_argument("--steps", type=int, default=50000)
    parser.add_argument("--stops", type=int, default=8)
    parser.add_argument("--threads", type=int, default=max(1, os.cpu_count() // 2),
                        help="of each of the two runs")
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE",
                        help="a key of the configuration, as for stymo-train")
    options = parser.parse_args()
    if options.steps <= 1000:
        parser.error("--steps must be above 1000, from where memory is watched")
    folder = options.folder
    if not (folder / "heads").exists():
        subprocess.run([options.bin / "stymo-synth", "--out", folder / "heads", "--count", "200",
                        "--size", "64", "--seed", "1"], check=True, stdout=subprocess.DEVNULL)

    def train(out: str, *more: str) -> subprocess.Popen:
        return subprocess.Popen(
            [options.bin / "stymo-train", "--config", root / "configs/demo-64.json", "--data",
             folder / "heads", "--out", folder / out, "--threads", str(options.threads), "--seed",
             "4", "--set", f"stage1.steps={options.steps}", "--set", "output.sample_steps=5000",
             "--set", "output.checkpoint_steps=1000",
             *(word for value in options.set for word in ("--set", value)), *more],
            stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)

    draws = random.Random(9)
    stops = sorted(draws.randrange(options.steps) for _ in range(options.stops))
    stopped = []
    other = threading.Thread(
        target=lambda: stopped.append(stopped_run(train, folder / "parts", stops, draws)))
    other.start()
    process = train("whole")
    watch = Watch(process.pid, "step", options.steps)
    while process.poll() is None and watch.look(last_step(folder / "whole")):
        time.sleep(0.5)
    flat = watch.is_flat(1000)
    other.join()
    ended, resumed, twice = stopped[0]
    equal = (folder / "whole/model.safetensors").read_bytes() == \
        (folder / "parts/model.safetensors").read_bytes()
    same = without_resumed(losses(folder / "whole"), resumed) == \
        without_resumed(losses(folder / "parts"), resumed)
    again = all(before == after for before, after in twice)
    print(f"stopped after steps {', '.join(map(str, stops))}: weights "
          f"{'are the same' if equal else 'DIFFER'}, reported losses "
          f"{'are the same' if same else 'DIFFER'}")
    print(f"losses reported before a stop and again from the checkpoint before it: {len(twice)}, "
          f"which {'are the same' if again else 'DIFFER'}")
    return 0 if flat and process.wait() == 0 and ended and equal and same and again else 1


if __name__ == "__main__":
    sys.exit(main())
