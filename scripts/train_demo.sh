#!/usr/bin/env bash
# Shows the whole pipeline in at most ten minutes on two cores: installs packages, builds, renders
# synthetic heads, trains a small model on them, fits it to a head that is held out, and renders an
# orbit of that head.
set -euo pipefail

usage="usage: scripts/train_demo.sh [--out DIR]   (DIR must not exist; default: runs/train_demo)"
out=""
while (($#)); do
    case "$1" in
    --out)
        (($# >= 2)) || { echo "train_demo.sh: --out needs a folder; $usage" >&2 && exit 2; }
        out="$(realpath --canonicalize-missing "$2")"
        shift 2
        ;;
    --help | -h) echo "$usage" && exit 0 ;;
    *) echo "train_demo.sh: unknown argument $1; $usage" >&2 && exit 2 ;;
    esac
done

cd "$(dirname "${BASH_SOURCE[0]}")/.."
out="${out:-$PWD/runs/train_demo}"
if [[ -e "$out" ]]; then
    echo "train_demo.sh: $out exists already; remove it or choose another --out" >&2
    exit 1
fi

mkdir -p "$out"
# An attempt that failed must not keep the next one from using the folder.
trap '[[ -e "$out/orbit.gif" ]] || rm -rf "$out"' EXIT

total_seconds=600
reserve_seconds=75 # for fitting and rendering
heads=600

say() { printf '\n== %s\n' "$*" >&2; }

say "packages and build"
scripts/install_packages.sh
cmake --preset release >/dev/null
cmake --build --preset release --target stymo-synth stymo-train stymo-fit stymo-render
bin=build/bin

say "rendering $heads synthetic heads"
data="$out/data"
"$bin/stymo-synth" --out "$data" --count "$heads" --size 64 --seed 1

# Training gets the rest of the ten minutes.
train_seconds=$((total_seconds - reserve_seconds - SECONDS))
if ((train_seconds < 60)); then
    echo "train_demo.sh: the build took so long that training is limited to one minute;" \
        "run the script again for a better face" >&2
    train_seconds=60
fi
train_minutes="$((train_seconds / 60)).$((train_seconds % 60 * 10 / 60))"
say "training for $train_minutes minutes"
"$bin/stymo-train" --config configs/demo-64.json --data "$data" --out "$out/run" \
    --max-minutes "$train_minutes"
model="$out/run/model.safetensors"

# The heads with the last ids are held out.
printf -v id '%05d' "$((heads - 1))"
say "fitting head $id, which is held out"
"$bin/stymo-fit" --model "$model" --data "$data" --id "$id" --out "$out/fit"

say "rendering an orbit"
"$bin/stymo-render" --model "$model" --codes "$out/fit/codes.json" --orbit 24 \
    --out "$out/orbit.gif"

cat <<END

Done in $((SECONDS / 60)) min $((SECONDS % 60)) s.
  $out/fit/fit.png      photo | encoder's first guess | fitted | mask
  $out/fit/report.json  the metrics above and the loss of every step
  $out/orbit.gif        an orbit around the fitted head
  $out/run/samples      the progress of the training
END
