#!/usr/bin/env bash
# Installs packages, builds into build/ and runs the tests. --slow adds the slow tests, --browser
# installs what the tests in Chromium need, which are skipped without it, and --python tests the
# Python package.
set -euo pipefail

usage="usage: scripts/test.sh [--slow] [--browser] [--python]
--slow: run the slow tests too, and build those that the usual build leaves out
--browser: install Chromium, Node.js and packages of npm, and test the viewer's page in Chromium
--python: install the Python package in build/python-env by pip, and test it"
# The tests of the tools, the longest of the fast ones, use one thread. Slow tests run alone.
selection=(--label-exclude slow --parallel 2)
browser=
python=
for argument in "$@"; do
    case "$argument" in
    --slow) selection=() ;;
    --browser) browser=1 ;;
    --python) python=build/python-env/bin/python ;;
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
[[ -n "$python" ]] || exit 0
python3 -m venv build/python-env
"$python" -m pip install .
STYMO_SOURCE_DIR=$PWD "$python" -m unittest discover tests/python
