#!/usr/bin/env bash
# Installs packages, builds into build/ and runs the tests. --slow adds the slow tests, --browser
# installs what the test of the viewer in Chromium needs. Without it that test is skipped.
set -euo pipefail

usage="usage: scripts/test.sh [--slow] [--browser]
--slow: run the slow tests too, and build those that the usual build leaves out
--browser: install Chromium, Node.js and playwright-core, and test the viewer's page in Chromium"
# The tests of the tools, the longest of the fast ones, use one thread. Slow tests run alone.
selection=(--label-exclude slow --parallel 2)
browser=
for argument in "$@"; do
    case "$argument" in
    --slow) selection=() ;;
    --browser) browser=1 ;;
    --help | -h) echo "$usage" && exit 0 ;;
    *) echo "test.sh: unknown argument $argument; $usage" >&2 && exit 2 ;;
    esac
done

cd "$(dirname "${BASH_SOURCE[0]}")/.."
scripts/install_packages.sh
if [[ -n "$browser" ]]; then  # while the build has the processors
    export STYMO_PLAYWRIGHT=$PWD/build/browser/node_modules
    scripts/install_browser.sh build/browser &
    browser=$!
fi
cmake --preset release
cmake --build --preset release
[[ -z "$browser" ]] || wait "$browser" ||
    echo "The test of the viewer in Chromium is skipped: it cannot be installed here."
ctest --preset release "${selection[@]}"
