#!/usr/bin/env bash
# Splats of stymo-export in Spark, a published viewer, in Chromium: three sides, in the file of
# STYMO_SPLAT_SHEET if it names one. Needs three and @sparkjsdev/spark of npm beside what run.sh
# needs. Usage: splat.sh STYMO_EXPORT STYMO_RENDER. Exits with 77 (skipped) where something is
# missing.
set -euo pipefail
exporter=${1:?usage: splat.sh STYMO_EXPORT STYMO_RENDER}
renderer=${2:?usage: splat.sh STYMO_EXPORT STYMO_RENDER}
here=$(cd "$(dirname "$0")" && pwd)

source "$here/prerequisites.sh"
need_packages @sparkjsdev/spark three

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
"$renderer" --sample 1 --out "$work" >/dev/null
"$exporter" splat --codes "$work/0000.json" --out "$work/face.spz" --count 10000
node "$here/sheet.mjs" "$here/splat.html" "$work/face.spz" "${STYMO_SPLAT_SHEET:-$work/sheet.jpg}" \
    "$modules" "$chromium"
