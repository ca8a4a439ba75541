"""Writes a folder of real files for each reader: make_seeds.py FOLDER. Fuzzing begins with them."""

import json
import pathlib
import struct
import sys

golden = pathlib.Path(__file__).resolve().parent.parent / "golden"
configurations = golden.parent.parent / "configs"
sizes = {"id": 100, "expr": 79, "tex": 100, "light": 27}
pose = {"yaw_deg": 12.5, "pitch_deg": -3.0, "roll_deg": 1e-3, "t": [0.1, -0.2, 5.3]}
# Short numbers, so that little of a file is digits.
code = {group: [i % 3 for i in range(size)] for group, size in sizes.items()}
landmarks = [[i % 10, 0.5] for i in range(68)]
landmark_vertices = [k // 48 for k in range(68)]  # of the mesh below; the mouth's are the last 20
label = [1, 0, 0, 0, 0, -1, 0, 0, 0, 0, -1, 2.7, 0, 0, 0, 1, 4.26, 0, 0.5, 0, 4.26, 0.5, 0, 0, 1]


def safetensors(tensors, metadata=None, element=("F32", "f")):
    """Tensors: name -> (shape, values)."""
    header, data = {}, b""
    if metadata:
        header["__metadata__"] = metadata
    for name, (shape, values) in tensors.items():
        begin = len(data)
        data += struct.pack(f"<{len(values)}{element[1]}", *values)
        header[name] = {"dtype": element[0], "shape": shape, "data_offsets": [begin, len(data)]}
    text = json.dumps(header).encode()
    return struct.pack("<Q", len(text)) + text + data


def mesh(shift):
    """Eyes above a mouth."""
    lines = ["mtllib a.mtl"] + [f"v {x} {y} {z}" for x, y, z in points(shift)]
    return "\n".join(lines + ["vt 0.5 0.5", "f 1/1 2/1 3/1 4/1", "f -1/1/1 -2//1 3"]) + "\n"


def points(shift=0):
    return [(k - 1 + shift, -4 if k % 2 else 3, 8) for k in range(4)]


def head():
    count = len(points())
    return {
        "mean": ([count, 3], [x for point in points() for x in point]),
        "basis.id": ([100, count, 3], [1] * (100 * count * 3)),
        "basis.expr": ([1, count, 3], [1] * (count * 3)),
        "triangles": ([1, 3], [0, 1, 2]),
        "landmarks68": ([68], landmark_vertices),
    }


def box(kind, contents):
    return struct.pack(">I", 8 + len(contents)) + kind + contents


def compact(file):
    return json.dumps(json.loads(file.read_text()), separators=(",", ":"))


def request(**more):
    return json.dumps({"face": "f1", "sliders": {"id": [1, -2]}, **more})


def is_small(file):
    return file.stat().st_size < 4096


def http(start, *lines, body=""):
    length = [f"Content-Length: {len(body)}"] if body else []
    return "\r\n".join([start, "Host: $HOST", *lines, *length, "", body])


def lpips_heads(prefix):
    channels = [64, 128, 256, 384, 384, 512, 512]
    return {
        f"{prefix}lin{k}.model.1.weight": ([1, count, 1, 1], [1] * count)
        for k, count in enumerate(channels)
    }


def crc32c(data):
    checksum = 0xFFFFFFFF
    for byte in data:
        checksum ^= byte
        for _ in range(8):
            checksum = checksum >> 1 ^ (0x82F63B78 if checksum & 1 else 0)
    return checksum ^ 0xFFFFFFFF


camera = {"yaw": 10, "pitch": -5, "roll": 2, "distance": 1.2}
face = {"id": "00000", "pose": pose, "code": code, "landmarks": landmarks}
outcome = {
    "file": "00000.png",
    "failure": "",
    "faces": [
        {
            "face": face,
            "landmark_error": 0.01,
            "was_aligned": True,
            "made_mask": False,
            "warnings": ["dark"],
            "mask_agreement": 0.9,
            "network_rotation": [1, 0, 0, 0, 1, 0, 0, 0, 1],
        }
    ],
}
metrics = {"l1": 0.1, "l1_mean": 0.1, "ssim": 0.9, "psnr": 20.0, "lpips": 0.2}
score = {
    "id": "00000",
    "head": {"initial": metrics, "fitted": metrics},
    "counting_samples": 0.5,
    "identity": {"photo": 0.7, "turned_15": 0.6, "turned_30": 0.5, "other": 0.1},
}
byte = ("I8", "b")
tiny_decoder = {
    "resolution": 16,
    "rays_per_side": 8,
    "field_width": 8,
    "field_layers": 2,
    "feature_channels": 8,
    "frequencies": 2,
    "block_channels": [6],
    "mask_channels": 2,
    "mapping_layers": 0,
}
no_encoder = {"codes": {"source": "morphable"}}
tiny_encoder = {"backbone": "small_conv", "head_width": 8}
numbers = ["seed", "step", "epoch_loss_sum", "epoch_loss_count", "failures", "best_validation"]
state = {key: "1" for key in [*numbers, "best_resolution", "mask_loss"]}
faces = "\n".join(json.dumps({**face, "id": f"{i:05}"}) for i in range(2)) + "\n"
small = {"a": ([2, 2], [1, 2, 3, 4]), "b": ([0], [])}
colors = b"nclx" + struct.pack(">HHHB", 12, 13, 0, 128)
seeds = {
    "face_index": ["0 0 cl p 0.1 -0.2 0.3 0 0 5.3 00000\n0 0 - - a b\n"],
    "safetensors": [safetensors(small, {"format": "x"}), safetensors({})]
    + [file.read_bytes() for file in golden.glob("safetensors/*.safetensors")],
    "torch": [file.read_bytes() for file in golden.glob("weights/*.p*")],
    "onnx": [file.read_bytes() for file in golden.glob("weights/*.onnx")],
    "onnx_plain": [file.read_bytes() for file in golden.glob("*/*.onnx") if is_small(file)],
    "onnx_network": [file.read_bytes() for file in golden.glob("onnx/face*.onnx")],
    "config": [compact(file) for file in configurations.glob("*.json")]
    + [b"stage1.steps=3", b'output.x="a"'],
    "faces": [faces, '{"id":"a"}\n\n{"id":"b"}'],
    "intrinsics": ['{"focal": 3.2, "cx": 0.5, "cy": 0.5}'],
    "eg3d": [json.dumps({"labels": [["0/a.png", label]]}), '{"labels": null}'],
    "color_tags": [
        box(b"ftyp", b"heic")
        + box(b"meta", bytes(4) + box(b"iprp", box(b"ipco", box(b"colr", colors)))),
        box(b"jP  ", bytes(4)) + box(b"jp2h", box(b"colr", b"\x02\0\0profile")),
        b"RIFF\0\0\0\0WEBPICCP\x02\0\0\0ab",
    ]
    + [file.read_bytes() for file in golden.glob("images/*.png")],
    "photo_ids": ['{"photos": ["00000", "00001"], "found": 2}'],
    "codes": [json.dumps({"code": code, "pose": pose}), json.dumps({"pose": pose})],
    "camera": [
        json.dumps({"pose": pose}),
        json.dumps({"labels": [["00000", label], ["00001", label]]}),
        json.dumps(label),
        "1 0 0 0  0 1 0 0  0 0 1 5  0 0 0 1",
        "1,0,0,0, 0,1,0,0, 0,0,1,5",
        '{"id": "00000", "pose": %s}\n{"id": "00001", "pose": %s}\n'
        % (json.dumps(pose), json.dumps(pose)),
    ],
    "head": [safetensors(head(), element=byte)],
    "obj": [mesh(0), mesh(1)],
    "obj_indices": [
        json.dumps({"expressions": ["jawOpen"], "idx_to_landmark_verts": landmark_vertices})
    ],
    "request": [
        request(camera=camera, layer="mask", quality="still"),
        request(camera={"eye": [0.1, 0, 0.6], "screen": 0.3}),
        request(x=0.5, y=0.4, color=[1, 0, 0.5]),
        request(keys=[camera, camera], seconds=2, fps=12, format="mp4"),
        request(source="f2", groups=["id", "tex"]),
        '{"seed": 3, "truncation": 0.7, "name": "new"}',
        '{"codes": "00ff"}',
        '{"file": "{}"}',
        "0.5",
    ],
    "tuned": [
        safetensors(
            {"decoder.field.density.weight": ([1, 8], [0] * 8)},
            {"format": "stymo-weight-changes-1", "model": "0"},
        )
    ],
    "progress": [
        json.dumps(outcome),
        '{"file": "a", "failure": "no face", "faces": []}',
        '{"size":256}\n{"file": "a", "failure": "no face", "faces": []}\n',
    ],
    "lpips": [
        safetensors(lpips_heads("squeeze."), element=byte),
        safetensors(lpips_heads(""), element=byte),
    ],
    "import": [
        safetensors(lpips_heads("module."), element=byte),
        *[file.read_bytes() for file in golden.glob("weights/*.p*")],
        *[file.read_bytes() for file in golden.glob("weights/*.onnx")],
    ],
    "model": [
        json.dumps({"decoder": tiny_decoder, **no_encoder}),
        json.dumps({"decoder": {**tiny_decoder, "conditioning": "concatenation"}, **no_encoder}),
        json.dumps({"decoder": tiny_decoder, "encoder": tiny_encoder}),
        '{"codes": {"source": "morphable"}}',
    ],
    "state": [
        safetensors({"state.epoch_losses": ([2], [1, 2]), "ema.a": ([1], [3])}, state),
    ],
    "checksums": [f"{crc32c(b'contents'):08x} 8 file\n"],
    "class_map": [file.read_bytes() for file in golden.glob("images/*.png")],
    "photo": [file.read_bytes() for file in golden.glob("images/*")],
    "http": [
        http("GET / HTTP/1.1"),
        http("GET /page/app.js HTTP/1.1", "Accept: */*", "Range: bytes=0-1"),
        http("POST /api/frame?x=0.5 HTTP/1.1", "Origin: http://$HOST", body=request(layer="mask")),
        http("POST /api/face HTTP/1.1", "X-Stymo-Session: 0", body='{"seed": 3}'),
        http("POST /api/weights HTTP/1.1", "Expect: 100-continue", body="a" * 100),
        http("POST /api/eyes HTTP/1.1", "Transfer-Encoding: chunked") + "1\r\na\r\n0\r\n\r\n",
        http("GET / HTTP/1.1", "Connection: keep-alive") + http("GET /api/job HTTP/1.0"),
        http("OPTIONS * HTTP/1.1", "Content-Length: 99999"),
    ],
    "scores": [json.dumps(score)],
}
for reader, files in seeds.items():
    folder = pathlib.Path(sys.argv[1]) / reader
    folder.mkdir(parents=True, exist_ok=True)
    for number, contents in enumerate(files):
        data = contents if isinstance(contents, bytes) else contents.encode()
        (folder / f"seed_{number}").write_bytes(data)
