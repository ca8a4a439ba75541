#!/usr/bin/env bash
# Runs tests as on older x86-64 processors, and compares what each of them computes with float64.
# Needs a build for every processor, on a processor with AVX-512 for all of the targets:
#     cmake -B build-any -G Ninja -DCMAKE_BUILD_TYPE=Release -DSTYMO_NATIVE=OFF
#     cmake --build build-any
# Usage: other_processors.sh BUILD tests [PROGRAM...]   the fast tests; without programs those of
#                                                       core, nn, render, train and fit
#        other_processors.sh BUILD results [FOLDER]     a table of results; qemu-user, if it is
#                                                       given as STYMO_QEMU=1, confirms SSE2
#        other_processors.sh BUILD as TARGET COMMAND    one command as on such a processor
set -euo pipefail
usage='usage: other_processors.sh BUILD tests [PROGRAM...] | results [FOLDER] | as TARGET COMMAND'
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)
build=$(realpath "${1:?$usage}")
command=${2:?$usage}
shift 2
grep -q '^STYMO_NATIVE:BOOL=OFF' "$build/CMakeCache.txt" || {
    echo "other_processors.sh: $build is built for this processor; use -DSTYMO_NATIVE=OFF" >&2
    exit 2
}
targets=(SSE2 SSSE3 SSE4 AVX2 AVX3)

# Runs a command as on a processor with this target: Highway's kernels, the C library's functions
# and OpenCV choose among fewer instructions.
as() {
    local glibc=-AVX512F opencv=AVX512-SKX
    case $1 in
    all) shift && "$@" && return ;;
    SSE2 | SSSE3) glibc+=,-SSE4_1,-SSE4_2,-AVX,-AVX2,-FMA opencv+=,SSE4.1,SSE4.2,AVX,FP16,AVX2 ;;
    SSE4) glibc+=,-AVX,-AVX2,-FMA opencv+=,AVX,FP16,AVX2 ;;
    AVX2) ;;
    AVX3) glibc= opencv= ;;
    esac
    STYMO_PROCESSOR=$1 LD_PRELOAD=$build/tests/libolder_processor.so \
        GLIBC_TUNABLES=glibc.cpu.hwcaps=$glibc OPENCV_CPU_DISABLE=$opencv "${@:2}"
}

tests() {
    local failed=0 target program
    for target in "${targets[@]}"; do
        for program in "$@"; do
            echo "$target: $program"
            as "$target" "$build/tests/test_$program" '~[slow]' | tail -2 || failed=1
        done
    done
    return $failed
}

results() {
    local folder=${1:-$(mktemp -d)} files=() target
    [[ -e $folder/faces ]] ||
        "$build/bin/stymo-synth" --out "$folder/faces" --count 2 --size 256 >/dev/null
    compute() { # what, its name
        "${@:3}" "$build/tests/processor_results" "$1" \
            "$root/configs/models/faces-256/model.safetensors" "$root/configs/faces-256.json" \
            "$folder/faces" "$folder/$2.safetensors"
    }
    compute reference float64
    for target in "${targets[@]}" all; do
        compute make "$target" as "$target"
        files+=("$target=$folder/$target.safetensors")
    done
    if [[ -n ${STYMO_QEMU:-} ]]; then
        compute make qemu64 qemu-x86_64 -cpu qemu64
        files+=("qemu64=$folder/qemu64.safetensors")
    fi
    "$build/tests/processor_results" compare "$folder/float64.safetensors" "${files[@]}"
}

export GOMP_SPINCOUNT=1000
case $command in
tests)
    (($#)) || set -- core nn render train fit
    tests "$@"
    ;;
results) results "$@" ;;
as)
    (($# > 1)) && [[ " ${targets[*]} all " == *" $1 "* ]] || { echo "$usage" >&2 && exit 2; }
    as "$@"
    ;;
*) echo "$usage" >&2 && exit 2 ;;
esac
