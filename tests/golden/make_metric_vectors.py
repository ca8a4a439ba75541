"""Writes metric_vectors.json beside this file: PSNR and SSIM of scikit-image for two small images.

The images are the closed form `image` below, which tests/core/test_metrics.cpp repeats, so only the
results are stored. Needs scikit-image (the values stored were made with 0.26.0): pip install
scikit-image
"""

import json
import pathlib

import numpy
from skimage.metrics import peak_signal_noise_ratio, structural_similarity


def image(height, width, channels, phase):
    row, column, channel = numpy.meshgrid(
        numpy.arange(height), numpy.arange(width), numpy.arange(channels), indexing="ij"
    )
    wave = numpy.sin(0.37 * row + 0.21 * column * (channel + 1) + phase) * numpy.cos(
        0.05 * row * column + phase
    )
    return 0.5 + 0.45 * wave


CASES = [
    {"height": 11, "width": 11, "channels": 3, "phase_a": 0.0, "phase_b": 0.4},
    {"height": 24, "width": 37, "channels": 3, "phase_a": 0.0, "phase_b": 0.1},
    {"height": 24, "width": 37, "channels": 3, "phase_a": 0.3, "phase_b": 2.5},
    {"height": 40, "width": 16, "channels": 1, "phase_a": 1.0, "phase_b": 1.2},
]

for case in CASES:
    size = case["height"], case["width"], case["channels"]
    a, b = image(*size, case["phase_a"]), image(*size, case["phase_b"])
    case["mean_absolute_error"] = float(numpy.abs(a - b).mean())
    case["peak_signal_to_noise_ratio"] = float(peak_signal_noise_ratio(a, b, data_range=1.0))
    case["structural_similarity"] = float(
        structural_similarity(
            a,
            b,
            gaussian_weights=True,
            sigma=1.5,
            use_sample_covariance=False,
            data_range=1.0,
            channel_axis=2,
        )
    )

path = pathlib.Path(__file__).with_name("metric_vectors.json")
path.write_text(json.dumps(CASES, indent=2) + "\n")
