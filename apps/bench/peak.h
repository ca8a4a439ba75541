#pragma once

/// What the machine can do at best, for comparison: on as many threads as `parallel_for` uses.
namespace stymo::kernels {

struct MachinePeak {
    double multiply_adds =
        0.0;  ///< float32, operations per second (two for each fused multiply-add)
    double bfloat16_multiply_adds =
        0.0;  ///< the same for dot products of bfloat16; 0 without such an instruction
    double float16_multiply_adds = 0.0;  ///< the same for multiply-adds in half precision
    double triad_bytes =
        0.0;  ///< per second, a = b + factor * c over arrays much larger than the caches
};

/// The best of several runs of each. Takes about a second.
[[nodiscard]] MachinePeak measure_machine_peak();
/// float32 operations per second of one run of some milliseconds: what the machine gives at this
/// very moment, which differs with the load and the heat of the processor.
[[nodiscard]] double measure_multiply_adds();

}  // namespace stymo::kernels
