#include "apps/bench/report/section.h"
#include "apps/bench/report/stability.h"

namespace stymo {

std::vector<ReportSection> report_sections() {
    return {stability_section()};
}

}  // namespace stymo
