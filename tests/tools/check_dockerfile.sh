#!/usr/bin/env bash
# Checks the Dockerfile where there is no Docker: it installs build packages by install_packages.sh
# alone, which must exist and be runnable, and names presets and a package that exist.
# Usage: check_dockerfile.sh ROOT. Prints one line per violation and exits with 1 if there is any.
set -u
cd "${1:?usage: check_dockerfile.sh ROOT}" || exit 2
failed=0
require() { # what, command
    "${@:2}" >/dev/null || { echo "Dockerfile: $1" && failed=1; }
}

for instruction in $(grep -oE '^[A-Z]+' Dockerfile | sort -u); do
    require "unknown instruction $instruction" grep -qw "$instruction" \
        <<<"FROM COPY WORKDIR RUN CMD"
done
require "builds on another Debian than the documented one" grep -q '^FROM debian:12 ' Dockerfile
require "scripts/install_packages.sh cannot be run" test -x scripts/install_packages.sh
for preset in $(grep -oE 'preset [a-z]+' Dockerfile | cut -d' ' -f2 | sort -u); do
    require "there is no preset $preset" \
        grep -q "\"configurePreset\": \"$preset\"" CMakePresets.json
done
folder=$(sed -n 's|^COPY --from=build /src/\([^/]*\)/.*|\1|p' Dockerfile)
require "no preset builds into $folder" grep -q "{sourceDir}/$folder\"" CMakePresets.json
# In the final image, only the package itself is installed by name.
while IFS= read -r package; do
    require "$package does not come from install_packages.sh" test "$package" = '/tmp/stymo_*.deb'
done < <(grep -oE 'apt-get install [^&]*' Dockerfile | sed 's/apt-get install//' | tr ' ' '\n' |
    grep -vE '^(--.*)?$')
exit $failed
