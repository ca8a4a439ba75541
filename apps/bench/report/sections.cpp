#include "apps/bench/report/section.h"

namespace stymo {

std::vector<ReportSection> report_sections() {
    return {};
}

}  // namespace stymo
