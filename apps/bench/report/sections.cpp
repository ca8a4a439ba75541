#include "apps/bench/report/omitted.h"
#include "apps/bench/report/quadrature.h"
#include "apps/bench/report/section.h"
#include "apps/bench/report/stability.h"

namespace stymo {

std::vector<ReportSection> report_sections() {
    return {
        quadrature_section(),
        stability_section(),
        omitted_section(),
    };
}

}  // namespace stymo
