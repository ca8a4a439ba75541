#!/usr/bin/env bash
# Builds the tests of core, nn and render for 64-bit ARM with Debian's cross compiler and runs the
# fast ones under qemu-user. Nothing is installed: Debian's arm64 libraries are unpacked into a
# folder. Needs the packages g++-aarch64-linux-gnu, qemu-user, cmake and ninja-build.
# Usage: arm64.sh BUILD [CATCH2 ARGUMENT...]   (without arguments: the fast tests)
# The folder BUILD then has the libraries (sysroot/), the programs and a log of each one's tests.
set -euo pipefail
source=$(realpath "$(dirname "${BASH_SOURCE[0]}")/../..")
mkdir -p "${1:?usage: arm64.sh BUILD [CATCH2 ARGUMENT...]}"
build=$(realpath "$1")
shift
sysroot=$build/sysroot
libraries=$sysroot/usr/lib/aarch64-linux-gnu

# A state of apt of its own, in which nothing is installed and everything is for arm64.
apt_arm64() {
    local state=$build/apt
    mkdir -p "$state"/{state,lists/partial,archives/partial}
    touch "$state/status"
    apt-get -qq -o APT::Architecture=arm64 -o APT::Architectures::=arm64 -o Debug::NoLocking=1 \
        -o Dir::State="$state/state" -o Dir::State::status="$state/status" \
        -o Dir::State::lists="$state/lists" -o Dir::Cache::archives="$state/archives" \
        -o Dir::Cache::pkgcache= -o Dir::Cache::srcpkgcache= -o APT::Sandbox::User=root "$@"
}

unpack_libraries() {
    [[ -e $build/unpacked ]] && return
    apt_arm64 update
    apt_arm64 install --yes --download-only --no-install-recommends \
        libc6-dev libstdc++6 libgomp1 catch2 nlohmann-json3-dev libeigen3-dev libhwy-dev \
        libpng-dev libjpeg-dev libgif-dev libwebp-dev liblcms2-dev zlib1g-dev libzip-dev \
        libopenimageio-dev openimageio-tools libopencv-dev libavformat-dev
    mkdir -p "$sysroot/usr"/{bin,sbin,lib}
    local folder package
    for folder in bin sbin lib; do ln -sfn "usr/$folder" "$sysroot/$folder"; done
    for package in "$build"/apt/archives/*.deb; do
        dpkg-deb --fsys-tarfile "$package" |
            tar --extract --keep-directory-symlink --directory "$sysroot"
    done
    # Links to absolute paths lead out of the folder.
    local link
    find "$sysroot" -type l -lname "/*" | while read -r link; do
        ln -sfn "$sysroot$(readlink "$link")" "$link"
    done
    # What their installation would do.
    ln -sfn blas/libblas.so.3 "$libraries/libblas.so.3"
    ln -sfn lapack/liblapack.so.3 "$libraries/liblapack.so.3"
    touch "$build/unpacked"
}

unpack_libraries
cmake -S "$source" -B "$build" -G Ninja -DCMAKE_BUILD_TYPE=Release -DSTYMO_NATIVE=OFF \
    -DCMAKE_TOOLCHAIN_FILE="$source/cmake/aarch64.cmake" -DSTYMO_SYSROOT="$sysroot" \
    -DSTYMO_BUILD_APPS=OFF -DSTYMO_DLIB=OFF ${STYMO_CMAKE_FLAGS:-}
cmake --build "$build" --target test_core test_nn test_render

failed=0
for tests in core nn render; do
    echo "arm64: $tests"
    qemu-aarch64 -L "$sysroot" -E GOMP_SPINCOUNT=1000 "$build/tests/test_$tests" \
        "${@:-~[slow]}" >"$build/test_$tests.log" 2>&1 || failed=1
    tail -3 "$build/test_$tests.log"
done
exit $failed
