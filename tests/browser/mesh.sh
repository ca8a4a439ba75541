#!/usr/bin/env bash
# Khronos' validator on a mesh of stymo-export: no errors and no warnings. Needs nodejs, and
# gltf-validator of npm, which STYMO_GLTF_VALIDATOR may name as a folder of node_modules.
# Usage: mesh.sh STYMO_EXPORT STYMO_RENDER. Exits with 77 (skipped) where something is missing.
set -euo pipefail
exporter=${1:?usage: mesh.sh STYMO_EXPORT STYMO_RENDER}
renderer=${2:?usage: mesh.sh STYMO_EXPORT STYMO_RENDER}
skip() {
    echo "skipped: $1"
    exit 77
}
command -v node >/dev/null || skip "node is not installed (apt-get install nodejs)"
modules=${STYMO_GLTF_VALIDATOR:-${NODE_PATH:-$(dirname "$0")/node_modules}}
[[ -d "$modules/gltf-validator" ]] ||
    skip "gltf-validator is not installed (scripts/install_browser.sh tests/browser)"

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
"$renderer" --sample 1 --out "$work" >/dev/null
"$exporter" mesh --codes "$work/0000.json" --texture 256 --out "$work/face.glb"
node -e '
const [modules, file] = process.argv.slice(1);
const validator = require(require("path").resolve(modules, "gltf-validator"));
validator.validateBytes(new Uint8Array(require("fs").readFileSync(file))).then((report) => {
  console.log(JSON.stringify({ ...report.issues, ...report.info.resources }));
  process.exit(report.issues.numErrors + report.issues.numWarnings > 0 ? 1 : 0);
});' "$modules" "$work/face.glb"
