#include "apps/bench/report/fitting.h"
#include "apps/bench/report/omitted.h"
#include "apps/bench/report/quadrature.h"
#include "apps/bench/report/rendering.h"
#include "apps/bench/report/section.h"
#include "apps/bench/report/stability.h"
#include "apps/bench/report/training.h"

namespace stymo {

std::vector<ReportSection> report_sections() {
    return {
        quadrature_section(), rendering_section(), fitting_section(), training_section(), stability_section(), omitted_section(),
    };
}

}  // namespace stymo
