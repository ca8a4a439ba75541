"""Writes the small images of tests/golden/images with Python's standard library alone, byte by byte
as the PNG standard says."""

import pathlib
import struct
import zlib

GREY, RGB, PALETTE, GREY_ALPHA, RGBA = 0, 2, 3, 4, 6
folder = pathlib.Path(__file__).parent / "images"


def chunk(kind, data):
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))


def png(name, width, height, depth, colour, rows, extra=()):
    header = struct.pack(">IIBBBBB", width, height, depth, colour, 0, 0, 0)
    data = zlib.compress(b"".join(b"\0" + bytes(row) for row in rows))
    body = (
        chunk(b"IHDR", header)
        + b"".join(chunk(*e) for e in extra)
        + chunk(b"IDAT", data)
        + chunk(b"IEND", b"")
    )
    (folder / name).write_bytes(b"\x89PNG\r\n\x1a\n" + body)


folder.mkdir(exist_ok=True)
# Indices 1 and 3 have one colour: only their indices tell them apart.
palette = (b"PLTE", bytes([0, 0, 0, 204, 0, 0, 76, 153, 0, 204, 0, 0]))
png("palette_8bit.png", 3, 2, 8, PALETTE, [[0, 1, 2], [3, 3, 0]], [palette])
png("palette_2bit.png", 4, 1, 2, PALETTE, [[0b00011011]], [palette])
png(
    "palette_transparent.png",
    3,
    2,
    8,
    PALETTE,
    [[0, 1, 2], [3, 3, 0]],
    [palette, (b"tRNS", bytes([0, 128]))],
)
png("grey_8bit.png", 3, 1, 8, GREY, [[0, 18, 255]])
png("grey_alpha.png", 2, 1, 8, GREY_ALPHA, [[200, 255, 200, 51]])
png("rgba.png", 2, 1, 8, RGBA, [[255, 100, 0, 255, 255, 100, 0, 51]])
png("rgb_16bit.png", 1, 1, 16, RGB, [struct.pack(">HHH", 0x0001, 0x8000, 0xFFFF)])
# Red, green over blue, white; orientation 6: the stored left column is the upright top row, from
# right to left.
tiff = b"II*\0" + struct.pack("<IHHHIHHI", 8, 1, 0x0112, 3, 1, 6, 0, 0)
png(
    "turned.png",
    2,
    2,
    8,
    RGB,
    [[255, 0, 0, 0, 255, 0], [0, 0, 255, 255, 255, 255]],
    [(b"eXIf", tiff)],
)
