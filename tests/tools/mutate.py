#!/usr/bin/env python3
"""Mutation testing of the numeric core: changes one operator or constant at a time, rebuilds, and
runs the fast tests, which should fail. Works on a copy of the committed sources in FOLDER.

Usage: mutate.py FOLDER [--count N] [--seed N] [--only FILE_PART]

Prints a line for each mutant and writes FOLDER/mutants.json. A mutant that does not compile is
replaced by another one. Exits with 1 if fewer than nine tenths are killed.
"""
import argparse
import json
import pathlib
import random
import re
import subprocess
import sys

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
test_seconds = 300


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


def run(command: list[str], folder: pathlib.Path, seconds: float) -> bool:
    try:
        done = subprocess.run(command, cwd=folder, timeout=seconds, stdout=subprocess.DEVNULL,
                              stderr=subprocess.DEVNULL)
        return done.returncode == 0
    except subprocess.TimeoutExpired:
        return False


def build(tree: pathlib.Path, tests: list[str]) -> bool:
    targets = [f"test_{name}" for name in tests]
    return run(["cmake", "--build", "build", "--target", *targets], tree, 3600)


def is_killed(tree: pathlib.Path, tests: list[str]) -> bool:
    # Each runs until its first failure.
    return not all(run([f"build/tests/test_{name}", "~[slow]", "--abort"], tree, test_seconds)
                   for name in tests)


def judge(tree: pathlib.Path, mutant: dict) -> str:
    file = tree / mutant["file"]
    original = file.read_text()
    lines = original.splitlines()
    lines[mutant["line"] - 1] = mutant["mutated"]
    file.write_text("\n".join(lines) + "\n")
    try:
        if not build(tree, mutant["tests"]):
            return "not built"
        return "killed" if is_killed(tree, mutant["tests"]) else "survived"
    finally:
        file.write_text(original)


def prepare(folder: pathlib.Path) -> pathlib.Path:
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
    if not build(tree, every) or is_killed(tree, every):
        sys.exit("mutate.py: the tests do not pass without a mutant")
    return tree


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=pathlib.Path)
    parser.add_argument("--count", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", default="", help="only files whose name contains this")
    arguments = parser.parse_args()
    tree = prepare(arguments.folder.resolve())
    judged = []
    for mutant in in_random_order(tree, arguments.only, random.Random(arguments.seed)):
        if len(judged) == arguments.count:
            break
        outcome = judge(tree, mutant)
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
