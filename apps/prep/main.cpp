#include <filesystem>
#include <iomanip>
#include <optional>
#include <sstream>

#include "apps/common/command_line.h"
#include "core/interrupt.h"
#include "core/progress.h"
#include "train/pose_network.h"
#include "train/prepare.h"

namespace {

void print_angle(std::ostream& text, const char* name, const stymo::AngleStatistics& angle) {
    text << '\n'
         << name << " " << angle.mean << " +- " << angle.deviation << " degrees, " << angle.lowest << " to " << angle.highest;
}

std::string text_of(const stymo::PrepareReport& report, const std::filesystem::path& folder) {
    std::ostringstream text;
    text << std::fixed << std::setprecision(1) << report.ok << " of " << report.found << " photos prepared in "
         << folder.string();
    if (report.without_mask > 0) text << "; " << report.without_mask << " without a mask (the whole frame is taken)";
    for (const stymo::BrokenFile& item : report.failed) text << "\nskipped " << item.file << ": " << item.reason;
    if (!report.poses) {
        text << "\nno poses (frontal is assumed): give --pose-net to estimate them";
        return text.str();
    }
    print_angle(text, "yaw", report.poses->yaw);
    print_angle(text, "pitch", report.poses->pitch);
    print_angle(text, "roll", report.poses->roll);
    text << "\nsubtracted medians: pitch " << report.poses->pitch_offset << ", roll " << report.poses->roll_offset << " degrees";
    return text.str();
}

}  // namespace

int main(int argc, char** argv) {
    stymo::CommandLine line("stymo-prep", "Makes a training set of photos that are aligned as FFHQ (square crops of heads).");
    std::filesystem::path photos;
    std::filesystem::path folder;
    std::optional<std::filesystem::path> pose_net;
    stymo::PrepareSettings settings;
    line.option("--photos", photos, "Folder in the FFHQ or CelebAMask-HQ format").required();
    line.option("--out", folder, "Folder to write: images, masks, faces.jsonl, camera.json, report.json").required();
    line.option("--size", settings.side, "Side of the images in pixels").range(8, 4096);
    line.option("--pose-net", pose_net, "Head pose network in an ONNX file: 3DDFA_V2 or 6DRepNet (default: no poses)");
    line.option("--distance", settings.distance, "Distance of the frontal camera from the head's origin").range(1, 100);
    line.option("--pivot-depth", settings.pivot_depth, "How far in front of the origin the middle of the photos lies")
        .range(-1, 0.99);
    line.flag("--overlay", settings.overlays, "Draw the heads' axes over the photos: overlays/axes_000.png, ...")
        .needs("--pose-net");
    return line.run(argc, argv, [&](const stymo::CommonOptions&) {
        std::optional<stymo::PoseNetwork> network;
        if (pose_net) network.emplace(*pose_net);
        const stymo::InterruptGuard guard;
        std::optional<stymo::Progress> progress;
        const stymo::PrepareReport report = stymo::prepare_aligned_photos(
            photos, folder, settings, network ? &*network : nullptr, [&](std::int64_t done, std::int64_t total) {
                if (!progress) progress.emplace(stymo::ProgressTask{"Photos", total, 0, "photos"});
                progress->update(done);
            });
        progress.reset();
        return stymo::AppResult{text_of(report, folder), stymo::to_json(report)};
    });
}
