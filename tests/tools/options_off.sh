#!/usr/bin/env bash
# Turns each CMake option that has a default of ON off, and each one of OFF on: the configuration
# must say what is off in one line, a few targets must build, and the tools must say what they lack.
# Usage: options_off.sh FOLDER [OPTION...]
#        FOLDER gets a build folder for each option. With a compiler cache (the environment variable
#        CMAKE_CXX_COMPILER_LAUNCHER=ccache) this takes as long as a few builds.
set -euo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)
mkdir -p "${1:?usage: options_off.sh FOLDER [OPTION...]}"
folder=$(realpath "$1")
model=$root/configs/models/faces-256/model.safetensors
shift
failed=0
wanted=" $* "

# Configures with one option and builds targets. False if the option is not among those asked for.
built() { # option, value, targets
    [[ $wanted == "  " || $wanted == *" $1 "* ]] || return 1
    build=$folder/$1
    echo "== $1=$2: ${*:3}"
    cmake -S "$root" -B "$build" -G Ninja "-D$1=$2" >"$build.configure.log" 2>&1 &&
        cmake --build "$build" --target "${@:3}" >"$build.build.log" 2>&1 ||
        { echo "FAILED: see $build.*.log" && failed=1 && return 1; }
}
# The command's output must have exactly one line that matches.
says() { # pattern, command
    local text
    text=$("${@:2}" 2>&1) || true
    if [[ $(grep -cE -- "$1" <<<"$text") == 1 ]]; then
        grep -E -- "$1" <<<"$text" | sed 's/^/   /'
    else
        printf 'FAILED: expected one line with "%s":\n%s\n' "$1" "$text"
        failed=1
    fi
}
off() { says "^-- Off: $1" cat "$build.configure.log"; }
lacks() { # target
    says 'unknown target' ninja -C "$build" "$1"
}

if built STYMO_MPI OFF stymo-train; then
    off 'training on several machines'
    says 'several machines: off' "$build/bin/stymo-train" --version
    says 'built without Open MPI' env OMPI_COMM_WORLD_SIZE=2 OMPI_COMM_WORLD_RANK=0 \
        "$build/bin/stymo-train" --config "$root/configs/demo-64.json" --data . --out "$folder/run"
fi
if built STYMO_DLIB OFF stymo-fit; then
    off 'finding faces in photos'
    says 'faces in photos: off' "$build/bin/stymo-fit" --version
    says 'this build is without dlib' "$build/bin/stymo-fit" --model "$model" \
        --image "$root/docs/tutorial/drawn.png" --out "$folder/fit"
fi
if built STYMO_NATIVE OFF stymo-render test_core; then
    off STYMO_NATIVE
    says 'vector instructions: SSE2' "$build/bin/stymo-render" --version
    says 'All tests passed' "$build/tests/test_core" '[ops]'
fi
if built STYMO_BUILD_APPS OFF stymo test_core; then
    off STYMO_BUILD_APPS
    lacks stymo-render
    says 'All tests passed' "$build/tests/test_core" '[ops]'
fi
if built STYMO_BUILD_TESTS OFF stymo-render; then
    off STYMO_BUILD_TESTS
    lacks test_core
    says 'stymo-render [0-9]' "$build/bin/stymo-render" --version
fi
if built BUILD_SHARED_LIBS ON stymo-render test_core; then
    says "libstymo.so.* => $build" ldd "$build/bin/stymo-render"
    says '0000[.]json$' "$build/bin/stymo-render" --model "$model" --sample 1 \
        --out "$folder/sample"
    says 'All tests passed' "$build/tests/test_core" '[ops]'
fi
if python3 -m nanobind --cmake_dir >/dev/null 2>&1 && built STYMO_PYTHON ON _stymo; then
    says '^0[.]' env PYTHONPATH="$build/python" python3 -c 'import stymo; print(stymo.__version__)'
fi
if built CMAKE_DISABLE_PRECOMPILE_HEADERS ON stymo-render test_core; then
    says 'stymo-render [0-9]' "$build/bin/stymo-render" --version
    says 'All tests passed' "$build/tests/test_core" '[ops]'
fi
if built CMAKE_UNITY_BUILD OFF stymo-render test_core; then
    says 'stymo-render [0-9]' "$build/bin/stymo-render" --version
    says 'All tests passed' "$build/tests/test_core" '[ops]'
fi
exit $failed
