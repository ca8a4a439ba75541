#!/usr/bin/env bash
# Runs the fast tests of core, nn and render as on older processors: SSE2 (qemu64), SSE4 (Nehalem)
# and AVX2 (Haswell). Needs qemu-user, and a build for every processor:
#     cmake -B build-any -G Ninja -DCMAKE_BUILD_TYPE=Release -DSTYMO_NATIVE=OFF
#     cmake --build build-any --target test_core test_nn test_render
# Usage: other_processors.sh BUILD. Takes about an hour on one core.
set -euo pipefail
build=${1:?usage: other_processors.sh BUILD}
failed=0
for processor in qemu64 Nehalem Haswell; do
    for tests in core nn render; do
        echo "$processor: $tests"
        qemu-x86_64 -cpu "$processor" "$build/tests/test_$tests" '~[slow]' \
            2> >(grep -v "^qemu-x86_64: warning" >&2) || failed=1
    done
done
exit $failed
