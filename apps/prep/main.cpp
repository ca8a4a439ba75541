#include <iomanip>
#include <optional>
#include <sstream>

#include "apps/common/command_line.h"
#include "apps/common/ranked_run.h"
#include "apps/common/table.h"
#include "apps/common/tool_options.h"
#include "apps/common/tools.h"
#include "apps/prep/pipeline.h"
#include "apps/prep/pose_command.h"
#include "core/clock.h"
#include "core/error.h"

namespace {

struct Options {
    stymo::FolderPreparation folders;
    stymo::PhotoPreparationSettings settings;
    bool no_overlay = false;
};

void print_angle(std::ostream& text, const char* name, const stymo::AngleStatistics& angle) {
    text << '\n'
         << name << " " << angle.mean << " +- " << angle.deviation << " degrees, " << angle.lowest
         << " to " << angle.highest;
}

std::string text_of(const stymo::PrepareReport& report, const Options& options) {
    std::ostringstream text;
    text << std::fixed << std::setprecision(1) << report.ok << " of " << report.found
         << " photos prepared in " << options.folders.out.string() << ": " << report.faces
         << " faces, " << report.aligned_already << " of them aligned already, "
         << report.made_masks << " with a new mask";
    if (report.mask_agreement)
        text << "; mean IoU of the new and the given masks: " << std::setprecision(3)
             << *report.mask_agreement << std::setprecision(1);
    for (const stymo::BrokenFile& item : report.failed)
        text << '\n' << stymo::one_line("skipped " + item.file + ": " + item.reason);
    if (!report.left_out.empty()) text << '\n' << stymo::left_out_text(report.left_out);
    for (const stymo::FaceWarning& item : report.warnings)
        text << "\n" << item.id << ": " << item.warning;
    text << "\nmedian landmark error: " << std::setprecision(2) << 100.0 * report.landmark_error
         << " percent of the image's side" << std::setprecision(1);
    print_angle(text, "yaw", report.poses.yaw);
    print_angle(text, "pitch", report.poses.pitch);
    print_angle(text, "roll", report.poses.roll);
    if (!options.settings.pose_network.empty())
        text << "\nsubtracted medians: pitch " << report.poses.pitch_offset << ", roll "
             << report.poses.roll_offset << " degrees";
    return text.str();
}

stymo::AppResult prepared(stymo::PreparationRun& run, const Options& options) {
    const double start = stymo::seconds_now();
    const stymo::PrepareOutcome outcome = run.lead();
    if (!outcome.report)
        stymo::fail("interrupted after ", outcome.done, " of ", outcome.found,
                    " photos; the same command continues from there, and the photos so far can "
                    "already be used as a data set");
    std::string text = text_of(*outcome.report, options);
    if (outcome.done_now > 0) {
        const double taken = stymo::seconds_now() - start;
        text +=
            '\n' + stymo::decimal(taken / static_cast<double>(outcome.done_now), 2) + " s a photo";
    }
    return {text, stymo::to_json(*outcome.report)};
}

stymo::AppResult prepare(Options options, const stymo::CommandLine& line) {
    if (options.folders.photos.empty()) stymo::fail<stymo::UsageError>("--photos is required");
    if (options.folders.out.empty()) stymo::fail<stymo::UsageError>("--out is required");
    if (options.settings.whole_head && !options.settings.pose_network.empty())
        stymo::fail<stymo::UsageError>(
            "--whole-head needs the poses of the fitted head; leave out --pose-net");
    options.folders.overlays = !options.no_overlay;
    stymo::warn_without_landmark_network(options.settings);
    std::optional<stymo::PhotoPreparation> preparation;
    std::optional<stymo::PreparationRun> run;
    return stymo::run_on_ranks("stymo-prep", [&](stymo::Ranks& ranks) {
        return stymo::RankedRun{.prepare =
                                    [&] {
                                        preparation.emplace(options.settings);
                                        run.emplace(options.folders, *preparation, line.settings(),
                                                    ranks);
                                    },
                                .state = [&] { return run->state(); },
                                .lead = [&] { return prepared(*run, options); },
                                .follow = [&] { run->follow(); }};
    });
}

}  // namespace

int stymo_prep(int argc, char** argv) {
    Options options;
    stymo::PhotoPreparationSettings& settings = options.settings;
    stymo::CommandLine line(
        "stymo-prep",
        "Makes a training set of photos: finds the faces, aligns them like FFHQ, masks the heads, "
        "and fits a head model for pose and codes. The same command continues an interrupted run; "
        "mpirun divides the folder.");
    line.option(
        "--photos", options.folders.photos,
        "folder of photos; masks/, parsing/ and the landmarks of faces.jsonl are used if present");
    line.option("--out", options.folders.out,
                "output folder: images, masks, faces.jsonl, camera.json, report.json, overlays")
        .keeps_results();
    line.option("--size", settings.side, "side of the images in pixels").range(8, 4096);
    stymo::declare_preparation_files(line, settings);
    line.flag("--all-faces", settings.all_faces,
              "prepare every face of a photo instead of the clearest one");
    line.flag("--new-masks", settings.new_masks,
              "make masks even where the folder has them, and report how well both agree");
    line.flag(
        "--whole-head", settings.whole_head,
        "cut out more than FFHQ's square where the head leaves it at the top or the sides, as "
        "that of a turned head does");
    line.option("--focal", settings.intrinsics.focal,
                "focal length of the cameras for which poses are fitted, in units of the image's "
                "side. A small one stands for photos taken from near by")
        .range(0.1, 100)
        .excludes("--pose-net");
    line.option("--distance", settings.pivot.distance,
                "with --pose-net: distance of the frontal camera from the head's origin")
        .range(1, 100)
        .needs("--pose-net");
    line.option("--pivot-depth", settings.pivot.pivot_depth,
                "with --pose-net: distance from the origin to the point of the face in the middle "
                "of the photos")
        .range(-1, 0.99)
        .needs("--pose-net");
    line.flag("--no-overlay", options.no_overlay,
              "do not write the contact sheets overlays/sheet_000.png, ...")
        .keeps_results();
    stymo::PoseCommand pose;
    stymo::Command pose_command =
        line.command("pose", "Converts a pose between programs, and draws the head's axes.",
                     [&](const stymo::CommonOptions&) { return stymo::convert_pose(pose); });
    stymo::declare_pose_command(pose_command, pose);
    return line.run(argc, argv,
                    [&](const stymo::CommonOptions&) { return prepare(options, line); });
}
