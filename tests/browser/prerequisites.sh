# What the tests in Chromium need, for other scripts to source: sets `chromium` and `modules`. Exits
# with 77 (skipped) where something is missing.
skip() {
    echo "skipped: $1"
    exit 77
}
command -v node >/dev/null || skip "node is not installed (apt-get install nodejs)"
chromium=$(command -v chromium || command -v chromium-browser) ||
    skip "Chromium is not installed (apt-get install chromium)"
modules=${STYMO_PLAYWRIGHT:-${NODE_PATH:-$(dirname "${BASH_SOURCE[0]}")/node_modules}}
need_packages() {
    local package
    for package in "$@"; do
        [[ -d "$modules/$package" ]] ||
            skip "$package is not installed (scripts/install_browser.sh tests/browser)"
    done
}
need_packages playwright-core
