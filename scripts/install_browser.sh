#!/usr/bin/env bash
# Installs what tests/browser needs: Chromium, Node.js and npm as Debian's packages where the
# commands are missing, and playwright-core, gltf-validator, three and @sparkjsdev/spark of npm in a
# folder.
# Usage: install_browser.sh FOLDER
set -euo pipefail
folder=${1:?usage: install_browser.sh FOLDER}
missing=()
for command in chromium node npm; do
    command -v "$command" >/dev/null || missing+=("${command/%node/nodejs}")
done
"$(dirname "${BASH_SOURCE[0]}")/install_packages.sh" "${missing[@]}"
mkdir -p "$folder"
[[ -d $folder/node_modules/@sparkjsdev ]] || timeout 300 npm install --no-audit --no-fund \
    --prefix "$folder" playwright-core gltf-validator three @sparkjsdev/spark
