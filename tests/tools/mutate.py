#!/usr/bin/env python3
"""Mutation testing of the numeric core: changes one operator or constant at a time, rebuilds, and
runs the fast tests, which should fail. Works on a copy of the committed sources in FOLDER.

Usage: mutate.py FOLDER [--count N] [--seed N] [--only FILE_PART]

Prints a line for each mutant and writes FOLDER/mutants.json. A mutant that does not compile is
replaced by another one. Exits with 1 if fewer than nine tenths are killed.
"""
import argparse
import json
import os
import pathlib
import random
import re
import subprocess
import sys
import time

root = pathlib.Path(__file__).resolve().parents[2]
# Sources, and the tests that ought to notice.
places = [("core/ops/*.cpp", ["core", "nn"]),
          ("core/kernels/*.cpp", ["core", "nn"]),
          ("core/kernels/*-inl.h", ["core", "nn"]),
          ("nn/losses.cpp", ["nn"]),
          ("nn/adversarial.cpp", ["nn"]),
          ("render/composit*.cpp", ["render", "nn"])]
changes = [(r" \+ ", " - "), (r" - ", " + "), (r" \* ", " / "), (r" / ", " * "),
           (r" < ", " <= "), (r" <= ", " < "), (r" > ", " >= "), (r" >= ", " > "),
           (r" == ", " != "), (r" && ", " || "), (r"\+= ", "-= "),
           (r"std::max\(", "std::min("), (r"std::min\(", "std::max("),
           (r"\b1\.0F?\b", "1.1"), (r"\b0\.5F?\b", "0.25"), (r"\b2\.0F?\b", "2.5"),
           (r"\? (-?\w+) : (-?\w+)", r"? \2 : \1")]
# Lines whose operators are not arithmetic, or whose change is seen by no test of values.
skipped = re.compile(r"^\s*(//|#|template|using|\*|static_assert|for_each|namespace)|<<|operator|"
                     r"fail<|HWY_|grain|parallel_for|static constexpr|&&\s*\w+\)|Args|include")


def mutants_of(tree: pathlib.Path, pattern: str, tests: list[str]) -> list[dict]:
    found = []
    for file in sorted(tree.glob(pattern)):
        for number, line in enumerate(file.read_text().splitlines()):
            if skipped.search(line):
                continue
            for before, after in changes:
                for match in re.finditer(before, line.split("//")[0]):
                    mutated = line[:match.start()] + match.expand(after) + line[match.end():]
                    found.append({"file": str(file.relative_to(tree)), "line": number + 1,
                                  "before": line.strip(), "after": mutated.strip(),
                                  "mutated": mutated, "tests": tests})
    return found


def in_random_order(tree: pathlib.Path, only: str, order: random.Random):
    """Yields all mutants. Each is drawn from a random place, so that small places are not lost
    among large ones."""
    queues = [mutants_of(tree, pattern, tests) for pattern, tests in places]
    queues = [[mutant for mutant in queue if only in mutant["file"]] for queue in queues]
    for queue in queues:
        order.shuffle(queue)
    while queues := [queue for queue in queues if queue]:
        yield order.choice(queues).pop()


def build(tree: pathlib.Path, tests: list[str]) -> bool:
    targets = [f"test_{name}" for name in tests]
    done = subprocess.run(["cmake", "--build", "build", "--target", *targets], cwd=tree,
                          stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    return done.returncode == 0


def is_killed(tree: pathlib.Path, tests: list[str], seconds: float) -> bool:
    """Runs the test programs side by side until the first failure of any."""
    # As CTest sets it: threads that spin for long are slow on a busy machine.
    environment = {**os.environ, "GOMP_SPINCOUNT": "1000"}
    running = [subprocess.Popen([f"build/tests/test_{name}", "~[slow]", "--abort"], cwd=tree,
                                env=environment, stdout=subprocess.DEVNULL,
                                stderr=subprocess.DEVNULL) for name in tests]
    end = time.monotonic() + seconds
    try:
        while running:
            codes = [program.poll() for program in running]
            if any(code not in (None, 0) for code in codes) or time.monotonic() > end:
                return True
            running = [program for program, code in zip(running, codes) if code is None]
            time.sleep(0.1)
        return False
    finally:
        for program in running:
            program.kill()
            program.wait()


def judge(tree: pathlib.Path, mutant: dict, seconds: float) -> str:
    file = tree / mutant["file"]
    original = file.read_text()
    lines = original.splitlines()
    lines[mutant["line"] - 1] = mutant["mutated"]
    file.write_text("\n".join(lines) + "\n")
    try:
        if not build(tree, mutant["tests"]):
            return "not built"
        return "killed" if is_killed(tree, mutant["tests"], seconds) else "survived"
    finally:
        file.write_text(original)


def prepare(folder: pathlib.Path) -> tuple[pathlib.Path, float]:
    """Returns the copy of the sources, and the longest time that its tests may take."""
    tree = folder / "sources"
    if not tree.exists():
        tree.mkdir(parents=True)
        archive = subprocess.run(["git", "archive", "HEAD"], cwd=root, check=True,
                                 capture_output=True).stdout
        subprocess.run(["tar", "x"], cwd=tree, input=archive, check=True)
    # File by file, and hardly optimised, so that little is compiled for each mutant.
    options = ["-G", "Ninja", "-DCMAKE_BUILD_TYPE=Release", "-DCMAKE_CXX_FLAGS_RELEASE=-O1",
               "-DCMAKE_UNITY_BUILD=OFF", "-DSTYMO_BUILD_APPS=OFF"]
    subprocess.run(["cmake", "-B", "build", *options], cwd=tree, check=True,
                   stdout=subprocess.DEVNULL)
    every = sorted({name for _, tests in places for name in tests})
    built = build(tree, every)
    start = time.monotonic()
    if not built or is_killed(tree, every, seconds=3600):
        sys.exit("mutate.py: the tests do not pass without a mutant")
    return tree, 60 + 5 * (time.monotonic() - start)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=pathlib.Path)
    parser.add_argument("--count", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", default="", help="only files whose name contains this")
    arguments = parser.parse_args()
    tree, seconds = prepare(arguments.folder.resolve())
    judged = []
    for mutant in in_random_order(tree, arguments.only, random.Random(arguments.seed)):
        if len(judged) == arguments.count:
            break
        outcome = judge(tree, mutant, seconds)
        print(f"{outcome}: {mutant['file']}:{mutant['line']}: {mutant['after']}", flush=True)
        if outcome == "not built":
            continue
        judged.append({key: mutant[key] for key in ("file", "line", "before", "after")} |
                      {"outcome": outcome})
        (arguments.folder / "mutants.json").write_text(json.dumps(judged, indent=1) + "\n")
    killed = sum(mutant["outcome"] == "killed" for mutant in judged)
    print(f"{killed} of {len(judged)} killed")
    sys.exit(0 if 10 * killed >= 9 * len(judged) else 1)


main()
