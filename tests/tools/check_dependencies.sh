#!/usr/bin/env bash
# Every package that scripts/install_packages.sh installs stands in docs/dependencies.md, and every
# row of its table in docs/stymo.spdx.json with the same licence.
# Usage: check_dependencies.sh ROOT. Prints one line per violation and exits with 1 if there is any.
set -euo pipefail
root=${1:?usage: check_dependencies.sh ROOT}
cd "$root"
page=docs/dependencies.md
list=docs/stymo.spdx.json
failed=0

violation() {
    echo "$1"
    failed=1
}

while IFS= read -r package; do
    grep -q "\`$package\`" "$page" || violation "$page: $package is missing"
done < <(sed -n '/^packages=(/,/^)/p' scripts/install_packages.sh |
    sed -E '1d; $d; s/#.*//; s/"\$@"//' | tr -s ' ' '\n' | sed '/^$/d')

licence_in_list() {
    sed -n "/\"name\": \"$1\"/,/\"licenseDeclared\"/p" "$list" |
        sed -n 's/.*"licenseDeclared": "\(.*\)".*/\1/p'
}
while IFS='|' read -r _ name licence _; do
    name=$(tr -d ' `' <<<"$name")
    licence=$(sed -E 's/^ +| +$//g' <<<"$licence")
    [[ "$(licence_in_list "$name")" == "$licence" ]] ||
        violation "$list: $name is not $licence; run scripts/write_spdx.py"
done < <(grep '^| `' "$page")
exit $failed
