"""A frame of the decoder of scripts/torch_peer.py in OpenVINO and ONNX Runtime, for
`stymo-bench render --peer scripts/onnx_peer.py --peer-python PYTHON`.

Needs PyTorch, which exports the decoder, and PyPI's openvino and onnxruntime. Measures "render" in
float32 and "render-bfloat16". The time that counts is OpenVINO's; ONNX Runtime's, which has no
bfloat16 on processors, follows in brackets.
usage: onnx_peer.py [--threads 2] [--width 256] [--layers 8] [--samples 64] [--res 512] [-n 3]
render|render-bfloat16
"""

import argparse, pathlib, statistics, tempfile, time, warnings
import numpy as np
import onnxruntime, openvino
import torch, torch.nn.functional as F
import torch_peer

CODES = {"id": 100, "expr": 79, "tex": 100, "light": 27}


def blur(x):
    """torch_peer.blur with the kernel as a constant, which the exporter requires."""
    line = torch.tensor([0.25, 0.5, 0.25])
    kernel = torch.outer(line, line).repeat(int(x.shape[1]), 1, 1, 1)
    return F.conv2d(F.pad(x, (1, 1, 1, 1), mode="replicate"), kernel, groups=int(x.shape[1]))


class Frame(torch.nn.Module):
    def __init__(self, options):
        super().__init__()
        self.decoder = torch_peer.Decoder(options.width, options.layers, options.res)
        self.samples = options.samples

    def forward(self, *codes):
        return self.decoder(list(codes), self.samples)[-1]


def export(options, path):
    warnings.simplefilter("ignore")  # of the exporter: constants that it does not fold
    torch_peer.blur = blur
    codes = tuple(torch.randn(1, size) for size in CODES.values())
    torch.onnx.export(
        Frame(options).eval(), codes, path, opset_version=13, input_names=list(CODES)
    )


def milliseconds(function, repeats):
    function()  # warm-up
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        function()
        times.append(1e3 * (time.perf_counter() - start))
    return statistics.median(times)


def openvino_frame(path, options, bfloat16):
    hints = {
        "INFERENCE_NUM_THREADS": options.threads,
        "INFERENCE_PRECISION_HINT": "bf16" if bfloat16 else "f32",
    }
    request = openvino.Core().compile_model(path, "CPU", hints).create_infer_request()
    return request.infer


def onnxruntime_frame(path, options):
    settings = onnxruntime.SessionOptions()
    settings.intra_op_num_threads = options.threads
    session = onnxruntime.InferenceSession(path, settings, providers=["CPUExecutionProvider"])
    return lambda codes: session.run(None, codes)


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    for name, default in (("threads", 2), ("width", 256), ("layers", 8), ("samples", 64)):
        parser.add_argument("--" + name, type=int, default=default)
    parser.add_argument("--res", type=int, default=512)
    parser.add_argument("--batch", type=int, default=1, choices=[1])
    parser.add_argument("-n", type=int, default=3)
    parser.add_argument("what", nargs="+", choices=["render", "render-bfloat16"])
    options = parser.parse_args()
    torch.manual_seed(0)
    codes = {k: np.random.randn(1, size).astype(np.float32) for k, size in CODES.items()}
    with tempfile.TemporaryDirectory() as folder:
        path = str(pathlib.Path(folder) / "decoder.onnx")
        export(options, path)
        for what in options.what:
            bfloat16 = what == "render-bfloat16"
            frame = openvino_frame(path, options, bfloat16)
            took = milliseconds(lambda: frame(codes), options.n)
            other = ""
            if not bfloat16:
                frame = onnxruntime_frame(path, options)
                other = f"; ONNX Runtime {milliseconds(lambda: frame(codes), options.n):.1f} ms"
            print(f"{what}: {took:.1f} ms  (OpenVINO{other})", flush=True)


if __name__ == "__main__":
    main()
