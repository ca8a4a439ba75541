#!/bin/sh
# Writes the manual page of a tool from its --help: manual_page.sh HELP2MAN TOOL VERSION PAGE.
# Files that the tool found on this machine are no defaults for others.
set -eu
help=--help
case $("$2" --help) in *--help-all*) help=--help-all ;; esac
mkdir -p "$(dirname "$4")"
"$1" --no-info --help-option="$help" --version-string="$3" \
    --name="$("$2" --help | sed -n '1s/\.$//p')" "$2" | sed 's|PATH=/[^ ]*|PATH|' >"$4.part"
mv "$4.part" "$4"
