#!/usr/bin/env bash
# Installs the Debian packages that building and testing need; does nothing if they are all there.
set -euo pipefail

packages=(
    build-essential cmake ninja-build pkg-config
    libhwy-dev nlohmann-json3-dev libcli11-dev catch2
    libopencv-dev libpng-dev zlib1g-dev libzip-dev libopenimageio-dev openimageio-tools # the CMake files of libopenimageio-dev refer to the tools
    libdlib-dev libdlib-data # optional: faces in photos as they come
)

missing=()
for package in "${packages[@]}"; do
    [[ "$(dpkg-query --show --showformat='${db:Status-Status}' "$package" 2>/dev/null || true)" == installed ]] || missing+=("$package")
done
((${#missing[@]})) || exit 0

if ! command -v apt-get >/dev/null; then
    echo "install_packages.sh: this system has no apt-get; install by hand what these Debian packages hold: ${missing[*]}" >&2
    exit 1
fi
as_root=()
if ((EUID != 0)); then
    if ! command -v sudo >/dev/null; then
        echo "install_packages.sh: neither root nor sudo; let an administrator run: apt-get install ${missing[*]}" >&2
        exit 1
    fi
    as_root=(sudo)
fi

echo "Installing ${missing[*]}" >&2
"${as_root[@]}" apt-get -qq update
"${as_root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get -qq install --yes --no-install-recommends "${missing[@]}" >/dev/null
