#!/usr/bin/env bash
# Computes networks and training steps of the paper's width with PyTorch, runs the tests that
# compare with the results, and prints the largest relative errors as a table. Needs a Python with
# torch, numpy and safetensors.
# Usage: agreement.sh [--python python3] [--build build] [--out DIR]
#        --out: folder for the vectors (600 MB); existing ones are not made again
set -euo pipefail
usage='usage: agreement.sh [--python python3] [--build build] [--out DIR]'
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)
python=python3
build=$root/build
out=
while (($#)); do
    case "$1" in
    --python) python=${2:?$usage} ;;
    --build) build=${2:?$usage} ;;
    --out) out=${2:?$usage} ;;
    *) echo "$usage" >&2 && exit 2 ;;
    esac
    shift 2
done
if [[ -z $out ]]; then
    out=$(mktemp -d)
    trap 'rm -rf "$out"' EXIT
fi

"$python" -c 'import numpy, safetensors, torch' || {
    echo "agreement.sh: $python lacks torch, numpy or safetensors; choose another with --python" >&2
    exit 1
}
make() { # file, script, arguments
    [[ -e $out/$1 ]] || (cd "$root/tests/golden" && "$python" "${@:2}") >&2
}
make agreement_float32.safetensors make_agreement_vectors.py --out "$out"
make discriminator_vectors.safetensors make_discriminator_vectors.py --out "$out" --side 128
make iresnet50.safetensors make_iresnet_vectors.py --large "$out"

log=$out/agreement.log
status=0
{
    for program in nn train; do
        STYMO_GOLDEN=$out "$build/tests/test_$program" "[agreement]" || status=1
    done
    # The difference of PyTorch's own float32 from its float64 is the scale for ours.
    (cd "$root/tests/golden" && "$python" make_agreement_vectors.py --out "$out" --float32 &&
        "$python" make_discriminator_vectors.py --out "$out" --side 128 --float32) || status=1
} >"$log" 2>&1
grep -v '^agreement |' "$log" >&2
echo "| what | tensors | type | largest error | norm of the errors |"
echo "|---|---|---|---|---|"
sed -n 's/^agreement //p' "$log"
exit $status
