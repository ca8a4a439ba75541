#!/usr/bin/env bash
# The table at the end of configs/keys.md is what `stymo-train --print-keys` prints.
# Usage: configuration_page.sh STYMO_TRAIN PAGE            fails if the page is out of date
#        configuration_page.sh STYMO_TRAIN PAGE --update   writes the table anew
set -euo pipefail
usage='usage: configuration_page.sh STYMO_TRAIN PAGE [--update]'
tool=${1:?$usage}
page=${2:?$usage}

text_above_table() { sed '/^| key |/,$d' "$page"; }
expected=$(text_above_table && "$tool" --print-keys)

if [[ ${3:-} == --update ]]; then
    printf '%s\n' "$expected" >"$page"
elif ! diff --label "$page" --label "stymo-train --print-keys" "$page" \
    <(printf '%s\n' "$expected"); then
    echo "$page is out of date; run $0 $tool $page --update"
    exit 1
fi
