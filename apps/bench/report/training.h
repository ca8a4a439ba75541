#pragma once

#include "apps/bench/report/section.h"
#include "train/train_config.h"

namespace stymo {

/// The first stage with 16, 32 and 64 samples on a ray: loss against time, on synthetic heads made for it.
[[nodiscard]] ReportSection training_section();

/// What it trains, the same as configs/demo-64.json but for steps and samples, without averaged weights.
[[nodiscard]] TrainConfig report_training(std::int64_t steps, std::int64_t samples_per_ray);

}  // namespace stymo
