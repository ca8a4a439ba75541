#!/usr/bin/env bash
# check_sources.sh must accept a clean tree and refuse each kind of violation, naming the file.
set -u
check="$(cd "$(dirname "$0")" && pwd)/check_sources.sh"
tree=$(mktemp -d)
trap 'rm -rf "$tree"' EXIT
failed=0

fresh_tree() {
    rm -rf "${tree:?}"/*
    mkdir -p "$tree"/core/{kernels,ops} "$tree"/nn/{engine,layers,models,pretrained,realtime}
    mkdir -p "$tree"/{render,train,fit,apps/demo}
    echo '#include "core/shape.h"' >"$tree/core/tensor.h"
    echo '#include <hwy/highway.h>' >"$tree/core/kernels/matrix.h"
    echo '#include "core/kernels/matrix.h"' |
        tee "$tree"/{core/ops/linalg,nn/engine/field}.cpp >/dev/null
    echo 'std::thread worker;' >"$tree/core/parallel.cpp"
    printf '#include "core/tensor.h"\n#include "nn/parameter_store.h"\n' \
        >"$tree/nn/layers/linear.cpp"
    printf '#include "render/camera.h"\n#include "nn/layers/linear.h"\n' \
        >"$tree/nn/models/decoder.h"
    echo '#include <Eigen/Core>' |
        tee "$tree"/{core/tensor_eigen,render/camera,fit/pose}.h >"$tree/fit/pose.cpp"
    printf '#include "fit/fitter.h"\n#include "nn/models/decoder.h"\n' >"$tree/fit/fitter.cpp"
    printf 'µ%.0s' $(seq 100) >"$tree/core/shape.cpp"
    printf '#include "fit/fitter.h"\n#include "train/trainer.h"\n' >"$tree/apps/demo/main.cpp"
}

refuses() { # what, file, its text
    fresh_tree
    mkdir -p "$(dirname "$tree/$2")"
    printf '%b' "$3" >"$tree/$2"
    local output
    if output=$("$check" "$tree") || [[ $output != *"$2"* ]]; then
        echo "not refused: $1 ($2): $output"
        failed=1
    fi
}

fresh_tree
if ! output=$("$check" "$tree"); then
    echo "a clean tree is refused: $output"
    failed=1
fi
refuses 'core includes nn' core/bad.cpp '#include "nn/layers/linear.h"\n'
refuses 'a layer includes render' nn/layers/bad.h '  #  include "render/camera.h"\n'
refuses 'a layer includes a model' nn/layers/bad.cpp '#include "nn/models/decoder.h"\n'
refuses 'render includes nn' render/bad.cpp '#include "nn/parameter_store.h"\n'
refuses 'train includes fit' train/bad.cpp '#include "fit/fitter.h"\n'
refuses 'fit includes train' fit/bad.cpp '#include "train/trainer.h"\n'
refuses 'the library includes an app' fit/bad.h '#include "apps/common/command_line.h"\n'
refuses 'an app includes a test' apps/demo/bad.cpp '#include "cases/stability/case.h"\n'
refuses 'a layer calls a kernel' nn/layers/bad.cpp '#include "core/kernels/shape.h"\n'
refuses 'a view calls a kernel' nn/realtime/bad.cpp '#include "core/kernels/shape.h"\n'
refuses 'a model includes a view' nn/models/bad.cpp '#include "nn/realtime/view.h"\n'
refuses 'a pretrained network includes a model' nn/pretrained/bad.cpp \
    '#include "nn/models/decoder.h"\n'
refuses 'core calls a kernel outside an op' core/bad.cpp '#include "core/kernels/shape.h"\n'
refuses 'a kernel includes an op' core/kernels/bad.h '#include "core/ops/linalg.h"\n'
refuses 'the engine includes a model' nn/engine/bad.h '#include "nn/models/decoder.h"\n'
refuses 'a header includes Highway' core/bad.h '#include <hwy/highway.h>\n'
refuses 'a header of core includes Eigen' core/kernels/bad.h '#include <Eigen/Core>\n'
refuses "a header of core includes Eigen's tensors" core/bad.h \
    '#include <unsupported/Eigen/CXX11/Tensor>\n'
refuses 'a header includes dlib' fit/bad.h '#include <dlib/array2d.h>\n'
refuses 'a header includes OpenImageIO' core/bad.h '#include <OpenImageIO/imageio.h>\n'
refuses 'a header includes OpenCV' core/kernels/bad.h '#include <opencv2/core.hpp>\n'
refuses 'a header includes nlohmann' nn/bad.h '#include <nlohmann/json.hpp>\n'
refuses 'OpenMP elsewhere' render/bad.cpp '#pragma omp parallel for\n'
refuses 'OpenMP in training' train/bad.cpp '#include <omp.h>\n'
refuses 'threads in the library' nn/bad.cpp 'std::thread worker;\n'
refuses 'a file that is too long' core/bad.cpp "$(printf '\\n%.0s' $(seq 601))"
refuses 'a line that is too long' core/bad.h "$(printf 'a%.0s' $(seq 101))\n"
exit $failed
