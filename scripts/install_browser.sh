#!/usr/bin/env bash
# Installs what tests/browser needs: Chromium and Node.js as Debian's packages, and playwright-core
# of npm in a folder. Usage: install_browser.sh FOLDER
set -euo pipefail
folder=${1:?usage: install_browser.sh FOLDER}
"$(dirname "${BASH_SOURCE[0]}")/install_packages.sh" chromium nodejs npm
mkdir -p "$folder"
[[ -d $folder/node_modules/playwright-core ]] ||
    timeout 120 npm install --no-audit --no-fund --prefix "$folder" playwright-core
