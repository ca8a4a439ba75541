#include "apps/bench/report/quadrature.h"
#include "apps/bench/report/section.h"

namespace stymo {

std::vector<ReportSection> report_sections() {
    return {quadrature_section()};
}

}  // namespace stymo
