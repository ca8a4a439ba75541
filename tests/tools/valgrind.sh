#!/usr/bin/env bash
# Runs the tools under valgrind: they draw faces, train a tiny model through both stages, fit it and
# render. Fails for any error of memory and any block that is lost. Needs valgrind, which knows
# neither AVX-512 nor AMX, and therefore a build for every processor:
#     cmake -B build-any -G Ninja -DCMAKE_BUILD_TYPE=Release -DSTYMO_NATIVE=OFF
#     cmake --build build-any --target stymo-synth stymo-train stymo-fit stymo-render
# Usage: valgrind.sh BUILD
set -euo pipefail
bin=$(realpath "${1:?usage: valgrind.sh BUILD}")/bin
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
cat >tiny.json <<'END'
{
  "decoder": {"resolution": 128, "field_width": 16, "field_layers": 2, "feature_channels": 16,
              "frequencies": 4, "block_channels": [16, 8], "mapping_layers": 1},
  "encoder": {"backbone": "small_conv", "head_width": 32},
  "reconstruction": {"resolution_weights": [0.5, 1.0], "perceptual_weight": 0,
                     "fit_samples_per_ray": 4},
  "data": {"split": {"test": 2, "val": 0, "held_out": "last"}},
  "stage1": {"steps": 2, "batch": 2, "micro_batch": 2, "samples_per_ray": 4},
  "stage2": {"resolutions": [64, 128], "images": [4, 4], "fade_images": [0, 2], "batch": [2, 2],
             "micro_batch": [1, 2], "r1_gamma": [0.1, 0.2], "r1_interval": 2,
             "augmentation_target": 0.1, "augmentation_images": 16, "samples_per_ray": 4},
  "discriminator": {"channel_multiplier": 2, "max_channels": 8, "group_size": 2},
  "output": {"checkpoint_steps": 3, "sample_steps": 3, "keep_last": 2, "statistics_images": 4}
}
END

# Without the variable the tool would start itself again, outside valgrind.
export GOMP_SPINCOUNT=1000
checked() {
    local begin=$SECONDS
    valgrind --quiet --error-exitcode=99 --leak-check=full --errors-for-leak-kinds=definite \
        --show-leak-kinds=definite --log-file=errors \
        "$bin/$1" "${@:2}" >output 2>&1 ||
        { tail -5 output && cat errors && echo "valgrind.sh: $1 failed" && exit 1; } >&2
    echo "$1: clean, $((SECONDS - begin)) s"
}
checked stymo-synth --out faces --count 6 --size 64
checked stymo-train --config tiny.json --data faces --out run
checked stymo-fit --model run/model.safetensors --data faces --id 00005 --out fit --steps 3
for mode in exact skip; do
    checked stymo-render --model run/model.safetensors --codes fit/codes.json --mode $mode \
        --out $mode.png
done
