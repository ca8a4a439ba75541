#!/usr/bin/env bash
# Writes the films of tests/golden/films with FFmpeg.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/films"
quiet=(-loglevel error -y -fflags +bitexact)
exact=(-flags:v +bitexact -map_metadata -1)

# Three bars, (200, 150, 120), (200, 50, 50) and (50, 200, 50), in the colour space of HD films.
bar() { printf 'color=c=0x%02x%02x%02x:s=32x32:d=0.2:r=10' "$@"; }
ffmpeg "${quiet[@]}" -f lavfi -i "$(bar 200 150 120)" -f lavfi -i "$(bar 200 50 50)" \
    -f lavfi -i "$(bar 50 200 50)" -filter_complex \
    'hstack=inputs=3,scale=out_color_matrix=bt709:out_range=tv,format=yuv444p' \
    -colorspace bt709 -color_primaries bt709 -color_trc bt709 -c:v libx264 -qp 0 \
    "${exact[@]}" bt709.mp4

# Every tenth frame of two seconds: no count of frames, and few for its length.
ffmpeg "${quiet[@]}" -f lavfi -i 'testsrc=s=32x32:d=2:r=30' -vf "select=not(mod(n\,10))" \
    -vsync vfr -c:v libvpx -b:v 20k "${exact[@]}" sparse.webm
