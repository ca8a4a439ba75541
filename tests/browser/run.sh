#!/usr/bin/env bash
# Tests the viewer's page in Chromium. Needs Debian's chromium and nodejs, and playwright-core of
# npm, which STYMO_PLAYWRIGHT or NODE_PATH may name as a folder of node_modules.
# Usage: run.sh STYMO_VIEW [--fast | TEST...]. Exits with 77 (skipped) where something is missing.
set -euo pipefail
viewer=${1:?usage: run.sh STYMO_VIEW [--fast | TEST...]}
shift
here=$(cd "$(dirname "$0")" && pwd)

source "$here/prerequisites.sh"

work=$(mktemp -d)
server=
cleanup() {
    [[ -z "$server" ]] || kill "$server" 2>/dev/null || true
    rm -rf "$work"
}
trap cleanup EXIT

: >"$work/log"
"$viewer" --port 0 --fit-steps 12 --color-steps 20 ${STYMO_VIEW_OPTIONS:-} 2>"$work/log" &
server=$!
for _ in $(seq 600); do
    address=$(sed -nE 's/^Open (http[^ ]+) .*/\1/p' "$work/log")
    [[ -z "$address" ]] || break
    kill -0 "$server" 2>/dev/null || { cat "$work/log" >&2; exit 1; }
    sleep 0.1
done
node "$here/viewer.mjs" "$address" "$modules" "$chromium" "$work" "$@"
