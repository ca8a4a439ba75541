#!/usr/bin/env bash
# Installs packages, builds into build/ and runs the tests. --slow adds the slow tests. The test in
# a browser is skipped unless Chromium, Node.js and playwright-core are there.
set -euo pipefail

usage="usage: scripts/test.sh [--slow]   (--slow: run the slow tests too)"
selection=(--label-exclude slow)
for argument in "$@"; do
    case "$argument" in
    --slow) selection=() ;;
    --help | -h) echo "$usage" && exit 0 ;;
    *) echo "test.sh: unknown argument $argument; $usage" >&2 && exit 2 ;;
    esac
done

cd "$(dirname "${BASH_SOURCE[0]}")/.."
scripts/install_packages.sh
cmake --preset release
cmake --build --preset release
ctest --preset release "${selection[@]}"
