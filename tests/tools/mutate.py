#!/usr/bin/env python3
"""Mutation testing of the numeric core: changes one operator or constant at a time, rebuilds, and
runs the fast tests, which should fail. Works on a copy of the committed sources in FOLDER.

Usage: mutate.py FOLDER [--count N] [--seed N] [--only FILE_PART]

Prints a line for each mutant and writes FOLDER/mutants.json. A mutant that does not compile is
replaced by another one. A run that was stopped goes on from that file. Exits with 1 if fewer than
nine tenths are killed.
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
          ("render/composit*.cpp", ["render", "nn"])]
# Tests that are run before the others of a program, because they find most.
likely = {"core": ["Every op has the value*", "Every op's gradients agree*"]}
changes = [(r" \+ ", " - "), (r" - ", " + "), (r" \* ", " / "), (r" / ", " * "),
           (r" < ", " <= "), (r" <= ", " < "), (r" > ", " >= "), (r" >= ", " > "),
           (r" == ", " != "), (r" && ", " || "), (r"\+= ", "-= "),
           (r"std::max\(", "std::min("), (r"std::min\(", "std::max("),
           (r"\b1\.0F?\b", "1.1"), (r"\b0\.5F?\b", "0.25"), (r"\b2\.0F?\b", "2.5"),
           (r"\? (-?\w+) : (-?\w+)", r"? \2 : \1")]
# Lines whose operators are not arithmetic, or whose change is seen by no test of values.
skipped = re.compile(r"^\s*(//|#|template|using|\*|static_assert|for_each|namespace)|<<|operator|"
                     r"fail<|HWY_|grain|parallel_for|static constexpr|&&\s*\w+\)|Args|include")


def runs_here(file: str) -> bool:
    """Whether this processor runs the code of a file: tiles need AMX or AVX512-BF16."""
    flags = pathlib.Path("/proc/cpuinfo").read_text()
    return "gemm_tiles" not in file or "amx_tile" in flags or "avx512_bf16" in flags


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


def build(tree: pathlib.Path, test: str) -> bool:
    done = subprocess.run(["cmake", "--build", "build", "--target", f"test_{test}"], cwd=tree,
                          stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    return done.returncode == 0


def passes(command: list[str], tree: pathlib.Path, seconds: float) -> bool:
    # As CTest sets it: threads that spin for long are slow on a busy machine.
    environment = {**os.environ, "GOMP_SPINCOUNT": "1000"}
    try:
        done = subprocess.run(command, cwd=tree, env=environment, timeout=seconds,
                              stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        return done.returncode == 0
    except subprocess.TimeoutExpired:
        return False


def outcome_of(tree: pathlib.Path, tests: list[str], seconds: float) -> str:
    """Builds and runs one test program after the other until the first failure."""
    for name in tests:
        if not build(tree, name):
            return "not built"
        for chosen in [*likely.get(name, []), "~[slow]"]:
            if not passes([f"build/tests/test_{name}", chosen, "--abort"], tree, seconds):
                return "killed"
    return "survived"


def judge(tree: pathlib.Path, mutant: dict, seconds: float) -> str:
    file = tree / mutant["file"]
    original = file.read_text()
    lines = original.splitlines()
    lines[mutant["line"] - 1] = mutant["mutated"]
    file.write_text("\n".join(lines) + "\n")
    try:
        return outcome_of(tree, mutant["tests"], seconds)
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
    for name in every:
        build(tree, name)
    start = time.monotonic()
    if outcome_of(tree, every, seconds=3600) != "survived":
        sys.exit("mutate.py: the tests do not pass without a mutant")
    return tree, 60 + 2 * (time.monotonic() - start)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=pathlib.Path)
    parser.add_argument("--count", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", default="", help="only files whose name contains this")
    arguments = parser.parse_args()
    tree, seconds = prepare(arguments.folder.resolve())
    results = arguments.folder / "mutants.json"
    known = json.loads(results.read_text()) if results.exists() else []
    judged, all_outcomes = [], []
    for mutant in in_random_order(tree, arguments.only, random.Random(arguments.seed)):
        if len(judged) == arguments.count:
            break
        if not runs_here(mutant["file"]):
            continue
        shown = {key: mutant[key] for key in ("file", "line", "before", "after")}
        outcome = next((row["outcome"] for row in known if shown.items() <= row.items()), None)
        is_new = outcome is None
        if is_new:
            outcome = judge(tree, mutant, seconds)
            print(f"{outcome}: {mutant['file']}:{mutant['line']}: {mutant['after']}", flush=True)
        all_outcomes.append(shown | {"outcome": outcome})
        if outcome != "not built":
            judged.append(all_outcomes[-1])
        if is_new:
            results.write_text(json.dumps(all_outcomes, indent=1) + "\n")
    killed = sum(mutant["outcome"] == "killed" for mutant in judged)
    print(f"{killed} of {len(judged)} killed")
    sys.exit(0 if 10 * killed >= 9 * len(judged) else 1)


main()
