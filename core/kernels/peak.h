#pragma once

namespace stymo::kernels {

/// What the machine does at most with the present number of threads: the measure of every other speed.
struct MachinePeak {
    double float32_flops = 0.0;   ///< operations a second of fused multiply-adds in registers, two for each
    double bfloat16_flops = 0.0;  ///< of dot products of bfloat16 pairs summed in float32; 0 without such an instruction
    double triad_bytes = 0.0;     ///< bytes a second of a = b + s c on arrays far larger than the caches, all three counted once
};

/// The best of several short runs of each; takes about half a second and 200 MB.
[[nodiscard]] MachinePeak measure_peak();

}  // namespace stymo::kernels
