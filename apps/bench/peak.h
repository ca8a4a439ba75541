#pragma once

/// Peak performance of the machine, for comparison, with as many threads as `parallel_for` uses.
namespace stymo::kernels {

enum class NumberFormat { float32, bfloat16 };

struct MachinePeak {
    /// Operations per second in float32 (two for each fused multiply-add).
    double multiply_adds = 0.0;
    /// The same for dot products of bfloat16; 0 without such an instruction.
    double bfloat16_multiply_adds = 0.0;
};

/// Takes the best of several runs of each measurement, in about a second.
[[nodiscard]] MachinePeak measure_machine_peak();
/// float32 operations per second in one run of some milliseconds: the current performance of the
/// machine, which varies with the load and the temperature of the processor.
[[nodiscard]] double measure_multiply_adds();

}  // namespace stymo::kernels
