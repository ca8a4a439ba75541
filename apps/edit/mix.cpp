#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "apps/common/tool_options.h"
#include "apps/edit/commands.h"
#include "core/clock.h"
#include "core/io/file.h"
#include "core/io/image.h"
#include "fit/edit/color_edit.h"
#include "fit/edit/style_mix.h"
#include "nn/models/code_file.h"
#include "nn/realtime/view.h"
#include "render/soft_edge.h"

namespace stymo {

namespace {

struct MixOptions {
    ModelOptions model;
    std::vector<std::string> sources;
    std::vector<std::string> targets;
    std::string take;
    std::int64_t sampled = 0;  ///< sources drawn from the training codes
    double truncation = 0.7;
    std::optional<std::int64_t> samples;
    std::filesystem::path out;
};

/// Each group by itself.
std::vector<CodeGroups> blocks_of(const CodeGroups& groups) {
    std::vector<CodeGroups> blocks;
    for (std::size_t i = 0; i < groups.size(); ++i) {
        CodeGroups block{};
        block[i] = true;
        if (groups[i]) blocks.push_back(block);
    }
    return blocks;
}

std::vector<std::string> names_of(const CodeGroups& groups) {
    std::vector<std::string> names;
    for (std::size_t i = 0; i < groups.size(); ++i)
        if (groups[i]) names.emplace_back(code_names[i]);
    return names;
}

std::vector<CodeFile> faces_of(const std::vector<std::string>& files, const std::string& mark) {
    std::vector<CodeFile> faces;
    for (const std::string& file : files) faces.push_back(read_code_file(file, mark));
    return faces;
}

/// Adds faces sampled from the distribution of the training codes to the sources, with names for
/// the report.
void add_sampled(const Model& model, MixOptions& options, std::vector<CodeFile>& sources,
                 std::uint64_t seed) {
    if (options.sampled > 0 && !model.code_statistics())
        fail<FileError>(model_file(options.model).string(),
                        ": holds no statistics of its training codes to draw faces from; train it "
                        "anew, or name a --source");
    Rng rng = Rng(seed).split("mix");
    for (std::int64_t i = 0; i < options.sampled; ++i) {
        sources.push_back({model.code_statistics()->sample(rng, options.truncation),
                           frontal_pose(model.config().camera)});
        options.sources.push_back("sample " + std::to_string(i));
    }
}

/// The result of the tool, whose JSON is also written to its folder.
AppResult written(const std::filesystem::path& out, const char* image, const JsonValue& report) {
    write_file(out / "report.json", report.text() + "\n", Durability::none);
    return {(out / image).string() + "\n", report};
}

AppResult mix_two(const Model& model, const MixOptions& options, const CodeFile& source,
                  const CodeFile& target, const ViewOptions& view) {
    const CodeGroups taken = parse_code_groups(options.take);
    const double start = seconds_now();
    const Codes mixed = mix_codes(target.codes, source.codes, taken);
    const Camera camera = camera_from_pose(target.pose, model.config().camera.intrinsics);
    const auto shown = [&](const Codes& codes) {
        const View seen = render_view(model, codes, 0, camera, view);
        return with_soft_edge(seen.image, seen.mask);
    };
    const Tensor before = shown(target.codes);
    const Tensor after = shown(mixed);
    const double change =
        mean_difference(before, after, Tensor::full({before.shape(0), before.shape(1), 1}, 1.0));
    write_image(options.out / "mix.png", tile_images({shown(source.codes), before, after}, 3));
    write_image(options.out / "render.png", after);
    write_code_file(options.out / "codes.json", mixed, 0, target.pose, target.model);
    return written(options.out, "mix.png",
                   JsonValue::object({{"source", options.sources.front()},
                                      {"target", options.targets.front()},
                                      {"taken", names_of(taken)},
                                      {"change_l1_mean", change},
                                      {"seconds", seconds_now() - start}}));
}

AppResult mix_sheet(const Model& model, const MixOptions& options,
                    const std::vector<CodeFile>& sources, const std::vector<CodeFile>& targets,
                    const ViewOptions& view) {
    const CodeGroups taken = parse_code_groups(options.take);
    const double start = seconds_now();
    write_image(options.out / "sheet.png",
                mixing_sheet(model, sources, targets, blocks_of(taken), view.samples_per_ray));
    return written(options.out, "sheet.png",
                   JsonValue::object({{"sources", options.sources},
                                      {"targets", options.targets},
                                      {"blocks", names_of(taken)},
                                      {"seconds", seconds_now() - start}}));
}

AppResult mix(MixOptions options, std::uint64_t seed) {
    const bool sheet =
        std::ssize(options.sources) + options.sampled > 1 || options.targets.size() > 1;
    if (options.sources.empty() && options.sampled == 0)
        fail<UsageError>("--source is required, or --sample");
    if (options.targets.empty()) fail<UsageError>("--target is required");
    if (options.take.empty() && !sheet)
        fail<UsageError>("--take is required: id, expr, tex, light, or several joined with commas");
    if (options.take.empty()) options.take = "expr,tex,light";
    static_cast<void>(parse_code_groups(options.take));
    for (const std::vector<std::string>& files : {options.sources, options.targets})
        require_not_read(options.out / "codes.json", {files.begin(), files.end()});
    const Model model = load_model(options.model, ModelParts::decoder);
    const ViewOptions view{.samples_per_ray = options.samples.value_or(
                               model.config().reconstruction.fit_samples_per_ray),
                           .mask = true};
    const std::string mark = model_mark(options.model);
    std::vector<CodeFile> sources = faces_of(options.sources, mark);
    add_sampled(model, options, sources, seed);
    const std::vector<CodeFile> targets = faces_of(options.targets, mark);
    require_writable_folder(options.out);
    return sheet ? mix_sheet(model, options, sources, targets, view)
                 : mix_two(model, options, sources.front(), targets.front(), view);
}

}  // namespace

void declare_mix(CommandLine& line) {
    const auto options = std::make_shared<MixOptions>();
    Command command = line.command(
        "mix",
        "Gives the target's face some groups of codes of the source, in the target's pose. Several "
        "sources or targets make a sheet: sources down, targets across, one block per group.",
        [options](const CommonOptions& common) { return mix(*options, common.seed); });
    declare_model(command, options->model);
    declare_tuned(command, options->model);
    command.option("--source", options->sources,
                   "codes.json of the face that provides the groups of --take; may be repeated");
    command.option(
        "--target", options->targets,
        "codes.json of the face that keeps the other groups and its pose; may be repeated");
    command.option("--take", options->take,
                   "groups to take from the source: id, expr, tex, light, joined by commas; a "
                   "sheet has one block per group, by default of expr, tex and light");
    command
        .option("--sample", options->sampled,
                "number of further sources, sampled from the distribution of the training codes "
                "with --seed")
        .range(0, 1000);
    command
        .option("--truncation", options->truncation,
                "scale of the variation of sampled faces: 1 is that of the training faces, 0 gives "
                "their mean")
        .range(0, 2)
        .needs("--sample");
    command.option("--samples", options->samples, "samples per ray (default: the model's setting)")
        .range(2, 4096);
    command
        .option("--out", options->out,
                "output folder: codes.json, render.png, mix.png (source | target | mixed) and "
                "report.json, or sheet.png and report.json")
        .required();
}

}  // namespace stymo
