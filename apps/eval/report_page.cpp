#include "apps/eval/report_page.h"

#include <iomanip>
#include <sstream>

namespace stymo {

namespace {

void write_table(std::ostream& page, const std::vector<FaceScore>& scores, bool lpips) {
    page << "| region | codes | | L1 (sum over RGB) | L1 (mean) |" << (lpips ? " LPIPS |" : "")
         << " SSIM | PSNR dB |\n"
         << "|---|---|---|---|---|" << (lpips ? "---|" : "") << "---|---|\n"
         << std::fixed;
    for (const SummaryRow& row : summary(scores)) {
        page << "| " << name_of(row.region) << " | " << name_of(row.stage) << " | "
             << (row.median ? "median" : "mean") << std::setprecision(4) << " | " << row.metrics.l1
             << " | " << row.metrics.l1_mean;
        if (lpips) page << " | " << row.metrics.lpips.value_or(0.0);
        page << " | " << row.metrics.ssim << " | " << std::setprecision(2) << row.metrics.psnr
             << " |\n";
    }
}

}  // namespace

std::string report_page(const Evaluation& evaluation, const ReportContext& context) {
    std::ostringstream page;
    page << "# Evaluation\n\n"
         << evaluation.scores.size() << " faces, " << evaluation.failed.size()
         << " failed. Both images are black outside the region; every number is an average over "
            "the full frame.\n\n";
    write_table(page, evaluation.scores, !context.lpips_network.empty());
    if (!context.lpips_network.empty()) page << "\nLPIPS: " << context.lpips_network << ".\n";
    page << '\n'
         << std::setprecision(1) << 100.0 * mean_counting_samples(evaluation.scores)
         << " % of the samples are significant. `scores.jsonl` has the scores of each face.\n";
    if (!evaluation.failed.empty()) {
        page << "\n## Failed\n\n";
        for (const FailedFace& face : evaluation.failed)
            page << "- " << face.id << ": " << face.reason << '\n';
    }
    page
        << "\n## Best, median and worst\n\n![sheet](sheet.png)\n\n"
        << "Target, initial, fitted, tuned if there is one, two views from yaw -30 and 30 degrees, "
           "error (|last face - target| within the region, mean over RGB, times 4).\n\n| row | "
           "face | | PSNR dB |\n|---|---|---|---|\n";
    for (std::size_t i = 0; i < context.rows.size(); ++i) {
        const SheetRow& row = context.rows[i];
        page << "| " << i + 1 << " | " << row.id << " | " << row.kind << " | "
             << std::setprecision(2) << row.psnr << " |\n";
    }
    page << "\n## Settings\n\n| option | value |\n|---|---|\n";
    for (const auto& [name, value] : context.settings)
        page << "| `" << name << "` | " << value.text() << " |\n";
    return page.str();
}

}  // namespace stymo
