#!/usr/bin/env bash
# A mesh of stymo-export in other programs: Khronos' validator has no errors and no warnings, and
# three.js in Chromium shows five sides and three blend shapes, in the file of STYMO_MESH_SHEET if
# it names one. Needs gltf-validator and three of npm beside what run.sh needs.
# Usage: mesh.sh STYMO_EXPORT STYMO_RENDER [OPTION...]; options are of stymo-export mesh. Exits with
# 77 (skipped) where something is missing.
set -euo pipefail
exporter=${1:?usage: mesh.sh STYMO_EXPORT STYMO_RENDER [OPTION...]}
renderer=${2:?usage: mesh.sh STYMO_EXPORT STYMO_RENDER [OPTION...]}
shift 2
[[ $# -gt 0 ]] || set -- --texture 256
here=$(cd "$(dirname "$0")" && pwd)

source "$here/prerequisites.sh"
need_packages gltf-validator three

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
"$renderer" --sample 1 --out "$work" >/dev/null
"$exporter" mesh --codes "$work/0000.json" --out "$work/face.glb" "$@"
node -e '
const [modules, file] = process.argv.slice(1);
const validator = require(require("path").resolve(modules, "gltf-validator"));
validator.validateBytes(new Uint8Array(require("fs").readFileSync(file))).then((report) => {
  console.log(JSON.stringify({ ...report.issues, ...report.info.resources }));
  process.exit(report.issues.numErrors + report.issues.numWarnings > 0 ? 1 : 0);
});' "$modules" "$work/face.glb"
node "$here/sheet.mjs" "$here/mesh.html" "$work/face.glb" "${STYMO_MESH_SHEET:-$work/sheet.jpg}" \
    "$modules" "$chromium"
