#!/usr/bin/env bash
# Installs the Debian packages that building and testing need, and those that are named. Does
# nothing if all are installed. Usage: install_packages.sh [PACKAGE...]
set -euo pipefail

packages=(
    build-essential cmake ninja-build pkg-config
    libeigen3-dev libhwy-dev nlohmann-json3-dev libcli11-dev catch2
    libopencv-dev libpng-dev libjpeg-dev libgif-dev libwebp-dev liblcms2-dev zlib1g-dev libzip-dev
    libavformat-dev
    libcpp-httplib-dev libtinygltf-dev
    libopenimageio-dev openimageio-tools # the CMake files of libopenimageio-dev refer to the tools
    libdlib-dev libdlib-data             # optional: finds faces in photos
    libopenmpi-dev openmpi-bin           # optional: training on several machines
    "$@"
)

missing=()
for package in "${packages[@]}"; do
    status=$(dpkg-query --show --showformat='${db:Status-Status}' "$package" 2>/dev/null || true)
    [[ "$status" == installed ]] || missing+=("$package")
done
((${#missing[@]})) || exit 0

if ! command -v apt-get >/dev/null; then
    echo "install_packages.sh: apt-get was not found; install the equivalents of these Debian" \
        "packages: ${missing[*]}" >&2
    exit 1
fi
as_root=()
if ((EUID != 0)); then
    if ! command -v sudo >/dev/null; then
        echo "install_packages.sh: needs root or sudo; ask an administrator to run:" \
            "apt-get install ${missing[*]}" >&2
        exit 1
    fi
    as_root=(sudo)
fi

echo "Installing ${missing[*]}" >&2
"${as_root[@]}" apt-get -qq update
"${as_root[@]}" env DEBIAN_FRONTEND=noninteractive \
    apt-get -qq install --yes --no-install-recommends "${missing[@]}" >/dev/null
