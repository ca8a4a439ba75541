#include "apps/eval/report_page.h"

#include <algorithm>
#include <iomanip>
#include <set>
#include <sstream>

#include "core/angle.h"
#include "core/error.h"
#include "core/io/image.h"
#include "core/ops/ops.h"
#include "nn/models/code_file.h"
#include "nn/models/display_image.h"
#include "nn/realtime/view.h"

namespace stymo {

namespace {

constexpr double error_gain = 4.0;

Tensor error_map(const FitReport& report, const Tensor& mask) {
    const Tensor& last = report.tuned.defined() ? report.tuned : report.fitted;
    const Variable difference =
        abs(Variable(masked_image(last, mask)) - masked_image(report.target, mask));
    const Variable grey = clamp(mean(difference, {2}) * error_gain, 0.0, 1.0);
    return broadcast_to(grey, last.shape()).value();
}

/// The codes and the tuned decoder that the evaluation has stored.
FittedFaces stored(const FitJob& job, const ComparedFace& face, const std::string& id,
                   const EvaluationOptions& options) {
    FittedFaces done = job.unfitted(face.batch);
    if (!options.fit) return done;
    const CodeFile file = read_code_file(options.folder->codes_of(id));
    done.fit.fitted = file.codes;
    done.fit.cameras = {camera_from_pose(file.pose, face.batch.cameras.front().intrinsics)};
    if (job.options().tunes())
        done.tuned.emplace(
            WeightChanges::load(options.folder->tuned_of(id)).applied_to(job.model()));
    return done;
}

std::int64_t position_of(const Dataset& faces, const std::string& id) {
    const auto found = std::ranges::find(faces.ids(), id);
    if (found == faces.ids().end()) fail<FileError>("the folder has no face ", id, " any more");
    return found - faces.ids().begin();
}

}  // namespace

std::vector<SheetRow> sheet_rows(const std::vector<FaceScore>& scores) {
    std::vector<const FaceScore*> order;
    for (const FaceScore& score : scores) order.push_back(&score);
    const auto psnr = [](const FaceScore* score) { return score->regions.front().last().psnr; };
    std::ranges::stable_sort(order, std::greater{}, psnr);
    const std::size_t count = order.size();
    const std::size_t each = count >= 9 ? 3 : 1;
    std::vector<SheetRow> rows;
    std::set<std::size_t> taken;
    const auto take = [&](const char* kind, std::size_t first) {
        for (std::size_t i = first; i < std::min(first + each, count); ++i)
            if (taken.insert(i).second) rows.push_back({kind, order[i]->id, psnr(order[i])});
    };
    take("best", 0);
    if (count >= 3) take("median", (count - each) / 2);
    if (count >= 2) take("worst", count - each);
    return rows;
}

Tensor score_sheet(const FitJob& job, const Dataset& faces, const EvaluationOptions& options,
                   const std::vector<SheetRow>& rows) {
    const Model& model = job.model();
    std::vector<Tensor> tiles;
    for (const SheetRow& row : rows) {
        const ComparedFace face = compared_face(model, faces, position_of(faces, row.id), options);
        const FittedFaces done = stored(job, face, row.id, options);
        const FitReport report = job.report(done, 0, face.masks.front(), nullptr);
        tiles.insert(tiles.end(), {report.target, report.initial, report.fitted});
        if (done.tuned) tiles.push_back(report.tuned);
        for (const double yaw_degrees : {-30.0, 30.0}) {
            const Camera camera = turned_camera(model.config().camera, head_middle,
                                                radians_from_degrees(yaw_degrees), 0.0, 0.0);
            const ViewOptions view{
                .samples_per_ray = model.config().reconstruction.fit_samples_per_ray,
                .resolution = report.target.shape(0)};
            tiles.push_back(
                render_view(done.tuned ? *done.tuned : model, done.fit.fitted, 0, camera, view)
                    .image);
        }
        tiles.push_back(error_map(report, display_mask(face.masks.front(), 0)));
    }
    return tile_images(tiles, options.fit && job.options().tunes() ? 7 : 6);
}

std::string report_page(const Evaluation& evaluation, const ReportContext& context) {
    std::ostringstream page;
    page << "# Evaluation\n\n"
         << evaluation.scores.size() << " faces, " << evaluation.failed.size()
         << " failed. Both images are black outside the region; every number is an average over "
            "the full frame.\n\n";
    page << markdown(summary_table(evaluation.scores)) << std::fixed;
    if (!context.lpips_network.empty()) page << "\nLPIPS: " << context.lpips_network << ".\n";
    page << '\n'
         << std::setprecision(1) << 100.0 * mean_counting_samples(evaluation.scores)
         << " % of the samples are significant. `scores.jsonl` has the scores of each face.\n";
    if (!evaluation.failed.empty()) {
        page << "\n## Failed\n\n";
        for (const FailedFace& face : evaluation.failed)
            page << "- " << face.id << ": " << face.reason << '\n';
    }
    Table sheet{"sheet", {"row", "face", "kind", "PSNR dB"}};
    for (const SheetRow& row : context.rows)
        sheet.rows.push_back({std::ssize(sheet.rows) + 1, row.id, row.kind, decimal(row.psnr, 2)});
    Table settings{"settings", {"option", "value"}};
    for (const auto& [name, value] : context.settings)
        settings.rows.push_back({"`" + name + "`", value.text()});
    page
        << "\n## Best, median and worst\n\n![sheet](sheet.png)\n\n"
        << "Target, initial, fitted, tuned if there is one, two views from yaw -30 and 30 degrees, "
           "error (|last face - target| within the region, mean over RGB, times 4).\n\n"
        << markdown(sheet) << "\n## Settings\n\n"
        << markdown(settings);
    return page.str();
}

}  // namespace stymo
