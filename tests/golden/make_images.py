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


def one_colour_jpeg(name, components):
    """8 x 8 pixels of one colour: each component is a single coefficient, its mean. Four components
    are CMYK, which Adobe's programs store inverted."""

    def segment(marker, data):
        return bytes([0xFF, marker]) + struct.pack(">H", len(data) + 2) + data

    # One code of 4 bits for each number of bits from 0 to 11, and "no more coefficients" as 0.
    means = segment(0xC4, bytes([0x00] + [0, 0, 0, 12] + [0] * 12 + list(range(12))))
    ends = segment(0xC4, bytes([0x10] + [1] + [0] * 15 + [0]))
    bits = ""
    for value in components:
        mean = 8 * (value - 128)  # the quantisation step is 1
        size = abs(mean).bit_length()
        bits += format(size, "04b")
        if size:
            bits += format(mean if mean > 0 else mean + (1 << size) - 1, f"0{size}b")
        bits += "0"
    bits += "1" * (-len(bits) % 8)
    scan = bytes(int(bits[i : i + 8], 2) for i in range(0, len(bits), 8))
    scan = scan.replace(b"\xff", b"\xff\0")
    count = len(components)
    frame = struct.pack(">BHHB", 8, 8, 8, count)
    frame += b"".join(bytes([i + 1, 0x11, 0]) for i in range(count))
    start = bytes([count]) + b"".join(bytes([i + 1, 0]) for i in range(count)) + bytes([0, 63, 0])
    (folder / name).write_bytes(
        b"\xff\xd8"
        + segment(0xEE, b"Adobe\0\x64\0\0\0\0\0")
        + segment(0xDB, bytes([0] + [1] * 64))
        + segment(0xC0, frame)
        + means
        + ends
        + segment(0xDA, start)
        + scan
        + b"\xff\xd9"
    )


folder.mkdir(exist_ok=True)
# No cyan, half magenta, all yellow, a quarter of black.
one_colour_jpeg("cmyk.jpg", [255, 128, 0, 192])
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
