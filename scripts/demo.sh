#!/usr/bin/env bash
# Turns a photo into a face that can be seen from any side: installs packages, builds the tools,
# fits the model that comes with stymo to the photo, tunes it, and renders an orbit. Without a photo
# it takes a public-domain portrait from a Debian package, or draws a face if that is not to be had.
set -euo pipefail

usage="usage: scripts/demo.sh [PHOTO] [--out DIR]   (DIR must not exist; default: runs/demo)"
photo=""
out=""
while (($#)); do
    case "$1" in
    --out)
        (($# >= 2)) || { echo "demo.sh: --out needs a folder; $usage" >&2 && exit 2; }
        out="$(realpath --canonicalize-missing "$2")"
        shift 2
        ;;
    --help | -h) echo "$usage" && exit 0 ;;
    -*) echo "demo.sh: unknown option $1; $usage" >&2 && exit 2 ;;
    *)
        [[ -z "$photo" ]] || { echo "demo.sh: one photo only; $usage" >&2 && exit 2; }
        [[ -f "$1" ]] || { echo "demo.sh: no file $1" >&2 && exit 1; }
        photo="$(realpath "$1")"
        shift
        ;;
    esac
done

cd "$(dirname "${BASH_SOURCE[0]}")/.."
out="${out:-$PWD/runs/demo}"
if [[ -e "$out" ]]; then
    echo "demo.sh: $out exists already; remove it or choose another --out" >&2
    exit 1
fi
mkdir -p "$out"
# An attempt that failed must not keep the next one from using the folder.
trap '[[ -e "$out/orbit.gif" ]] || rm -rf "$out"' EXIT

say() { printf '\n== %s\n' "$*" >&2; }

# NASA's portrait of Eileen Collins, in the public domain, as scikit-image distributes it.
fetch_portrait() {
    local packages portrait=usr/lib/python3/dist-packages/skimage/data/astronaut.png
    packages="$(mktemp --directory)"
    (cd "$packages" && apt-get -qq download python3-skimage 2>/dev/null &&
        dpkg-deb --fsys-tarfile python3-skimage_*.deb |
        tar --extract --to-stdout "./$portrait" >"$out/photo.png") || true
    rm -rf "$packages"
    if [[ -s "$out/photo.png" ]]; then photo="$out/photo.png"; else rm -f "$out/photo.png"; fi
}

say "packages and build"
scripts/install_packages.sh
cmake --preset release >/dev/null
cmake --build --preset release --target stymo-fit stymo-render
bin=build/bin
built=$SECONDS

[[ -n "$photo" ]] || fetch_portrait
if [[ -n "$photo" ]]; then
    say "fitting the face in $photo"
    "$bin/stymo-fit" --image "$photo" --steps 30 --tune 28 --matmul-precision medium \
        --out "$out"
    face=(--codes "$out/codes.json" --tuned "$out/tuned.safetensors")
    made="$out/fit.png      photo | first guess | fitted | tuned | mask
  $out/codes.json   the face as 306 numbers, $out/tuned.safetensors the tuned weights"
else
    say "drawing a face, because there is no photo"
    "$bin/stymo-render" --sample 1 --out "$out/drawn"
    face=(--codes "$out/drawn/0000.json")
    made="$out/drawn        the drawn face and its codes"
fi

say "rendering an orbit"
"$bin/stymo-render" "${face[@]}" --orbit 48 --out "$out/orbit.gif"
"$bin/stymo-render" "${face[@]}" --grid-yaw -30:30:5 --out "$out/views.png"

cat <<END

Done in $((SECONDS / 60)) min $((SECONDS % 60)) s, of which $((SECONDS - built)) s after the build.
  $out/orbit.gif    the face from all sides
  $out/views.png    five views
  $made
END
