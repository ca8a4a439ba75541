#include <algorithm>
#include <charconv>
#include <cmath>
#include <filesystem>
#include <iomanip>
#include <memory>
#include <optional>
#include <sstream>
#include <string>

#include "apps/common/explain.h"
#include "apps/common/table.h"
#include "apps/common/tool_options.h"
#include "apps/edit/commands.h"
#include "core/clock.h"
#include "core/interrupt.h"
#include "core/io/file.h"
#include "core/io/image.h"
#include "core/progress.h"
#include "fit/edit/color_edit.h"
#include "fit/photo/face_parser.h"
#include "nn/models/code_file.h"
#include "nn/models/display_image.h"
#include "nn/realtime/view.h"
#include "render/soft_edge.h"

namespace stymo {

namespace {

struct ColorOptions {
    ModelOptions model;
    std::filesystem::path codes;
    std::filesystem::path parser;
    std::filesystem::path out;
    std::string part;
    std::string color;
    std::string term = "mean";
    std::optional<std::int64_t> samples;
    std::optional<double> learning_rate, regularizer;  ///< empty: keep_near_faces
    ColorEditOptions edit;
};

/// "#a03020" as RGB in [0, 1].
Eigen::Vector3d color_of(const std::string& text) {
    Eigen::Vector3d color = Eigen::Vector3d::Zero();
    const bool shaped = text.size() == 7 && text.front() == '#';
    for (std::size_t channel = 0; channel < 3; ++channel) {
        int value = 0;
        const char* digits = text.data() + 1 + 2 * channel;
        if (!shaped || std::from_chars(digits, digits + 2, value, 16).ptr != digits + 2 ||
            value < 0)
            fail<UsageError>("--color ", text, ": give six hexadecimal digits, such as '#a03020'");
        color[channel] = value / 255.0;
    }
    return color;
}

std::string text_of(const Eigen::Vector3d& color) {
    std::ostringstream text;
    text << '#' << std::hex << std::setfill('0');
    for (const double channel : color)
        text << std::setw(2) << std::lround(255.0 * std::clamp(channel, 0.0, 1.0));
    return text.str();
}

/// "hair", "lips", "skin+nose".
ParsingClassSet parts_of(const std::string& text) {
    ParsingClassSet parts{};
    const auto add = [&](const std::string& name) {
        const auto found = std::ranges::find(parsing_class_names, name);
        const auto index = static_cast<int>(found - parsing_class_names.begin());
        if (!is_head_class(index)) {
            std::string names;
            for (int known = 0; known < parsing_class_count; ++known)
                if (is_head_class(known))
                    names += std::string(names.empty() ? "" : ", ") +
                             parsing_class_names[static_cast<std::size_t>(known)];
            fail<UsageError>("--part ", text, ": \"", name,
                             "\" is no part of a head; there are lips, ", names);
        }
        parts[static_cast<std::size_t>(index)] = true;
    };
    std::istringstream stream(text);
    for (std::string name; std::getline(stream, name, '+');) {
        if (name == "lips") {
            add("u_lip");
            add("l_lip");
        } else {
            add(name);
        }
    }
    return parts;
}

/// The image with a square of one colour in its upper right corner.
Tensor with_patch(Tensor image, const Eigen::Vector3d& color) {
    const std::int64_t side = image.shape(1);
    const std::int64_t patch = std::max<std::int64_t>(side / 6, 1);
    const std::span<float> values = image.mutable_values<float>();
    for (std::int64_t y = 0; y < patch; ++y)
        for (std::int64_t x = side - patch; x < side; ++x)
            for (std::int64_t channel = 0; channel < 3; ++channel)
                values[static_cast<std::size_t>((y * side + x) * 3 + channel)] =
                    static_cast<float>(color[static_cast<std::size_t>(channel)]);
    return image;
}

/// Pixels of the part to edit, and of the rest.
struct Regions {
    Tensor part;
    Tensor rest;       ///< everything else
    Tensor head_rest;  ///< pixels of the rest that belong to the head
};

Regions regions_of(const Tensor& classes, const ParsingClassSet& parts) {
    ParsingClassSet rest{};
    ParsingClassSet head_rest{};
    const ParsingClassSet head = head_of_parts();
    for (std::size_t i = 0; i < parts.size(); ++i) {
        rest[i] = !parts[i];
        head_rest[i] = head[i] && !parts[i];
    }
    return {part_mask(classes, parts), part_mask(classes, rest), part_mask(classes, head_rest)};
}

std::int64_t pixels_of(const Tensor& mask) {
    return std::ranges::count(mask.values<float>(), 1.0F);
}

AppResult report_of(const ColorOptions& options, const ColorEdit& edit, const Regions& regions,
                    double seconds) {
    const Eigen::Vector3d target = color_of(options.color);
    const Eigen::Vector3d before = mean_color(edit.before, regions.part);
    const Eigen::Vector3d after = mean_color(edit.after, regions.part);
    const double share = share_of_way(before, after, target);
    const double rest = mean_difference(edit.before, edit.after, regions.rest);
    const double head_rest = mean_difference(edit.before, edit.after, regions.head_rest);
    const JsonValue json = JsonValue::object({{"part", options.part},
                                              {"pixels", pixels_of(regions.part)},
                                              {"before", text_of(before)},
                                              {"target", text_of(target)},
                                              {"after", text_of(after)},
                                              {"share_of_way", share},
                                              {"outside_l1_mean", rest},
                                              {"outside_in_head_l1_mean", head_rest},
                                              {"steps", edit.losses.size()},
                                              {"seconds", seconds},
                                              {"loss", edit.losses}});
    return {text_from(options.part, ": ", text_of(before), " -> ", text_of(after), ", target ",
                      text_of(target), '\n', decimal(100.0 * share, 1),
                      " % of the way\nmean absolute change outside the part ", decimal(rest, 4),
                      ", of these in the head ", decimal(head_rest, 4), '\n', decimal(seconds, 1),
                      " s\n"),
            json};
}

AppResult color(ColorOptions options) {
    const Eigen::Vector3d target = color_of(options.color);
    const ParsingClassSet parts = parts_of(options.part);
    options.edit.term = options.term == "pixels" ? ColorTerm::pixels : ColorTerm::mean;
    require_not_read(options.out / "codes.json", {options.codes});
    const Model model = load_model(options.model, ModelParts::decoder);
    options.edit.samples_per_ray =
        options.samples.value_or(model.config().reconstruction.fit_samples_per_ray);
    keep_near_faces(model, options.edit);
    if (options.learning_rate) options.edit.learning_rate = *options.learning_rate;
    if (options.regularizer) options.edit.regularizer = *options.regularizer;
    const CodeFile face = read_own_codes(options.codes, options.model);
    FaceParser parser(options.parser);
    const Camera camera = camera_from_pose(face.pose, model.config().camera.intrinsics);
    const View view = render_view(model, face.codes, 0, camera,
                                  {.samples_per_ray = options.edit.samples_per_ray, .mask = true});
    const Regions regions = regions_of(parser.parse_head(view.image, view.mask), parts);
    if (pixels_of(regions.part) == 0)
        fail<ValueError>(options.codes.string(), ": the parser finds no ", options.part,
                         " on the rendered face; choose another --part or --parser");
    require_writable_folder(options.out);

    const InterruptGuard guard;
    Progress progress({.title = "color", .total = options.edit.steps, .unit = "steps"});
    options.edit.on_step = [&](std::int64_t step, double loss) {
        progress.update(step, "loss " + std::to_string(loss));
    };
    const double start = seconds_now();
    const ColorEdit edit =
        edit_color(model, face.codes, camera, regions.part, target, options.edit);
    const double seconds = seconds_now() - start;
    progress.finish();

    AppResult result = report_of(options, edit, regions, seconds);
    const View changed =
        render_view(model, edit.codes, 0, camera,
                    {.samples_per_ray = options.edit.samples_per_ray, .mask = true});
    const Tensor before = with_soft_edge(edit.before, view.mask),
                 after = with_soft_edge(edit.after, changed.mask);
    write_image(options.out / "color.png",
                tile_images({with_patch(before, mean_color(edit.before, regions.part)),
                             with_patch(masked_image(edit.before, regions.part), target),
                             with_patch(after, mean_color(edit.after, regions.part))},
                            3));
    write_image(options.out / "render.png", after);
    write_code_file(options.out / "codes.json", edit.codes, 0, face.pose, face.model);
    write_file(options.out / "report.json", result.json.text() + "\n", Durability::none);
    const std::int64_t steps = std::ssize(edit.losses);
    if (steps < options.edit.steps)
        result.incomplete = "interrupted after " + std::to_string(steps) + " of " +
                            std::to_string(options.edit.steps) + " steps";
    count_for_report("steps", steps);
    return result;
}

}  // namespace

void declare_color(CommandLine& line) {
    const auto options = std::make_shared<ColorOptions>();
    Command command =
        line.command("color", "Changes the colour of a part of a fitted face and keeps the rest.",
                     [options](const CommonOptions&) { return color(*options); });
    declare_model(command, options->model);
    declare_tuned(command, options->model);
    command.option("--codes", options->codes, "codes.json of a fit").required();
    command
        .option("--part", options->part,
                "hair, skin, lips, any class of a head in CelebAMask-HQ, or several joined by +")
        .required();
    command.option("--color", options->color, "target colour, such as '#a03020'").required();
    command
        .option("--parser", options->parser,
                "face parser in an ONNX file; finds the part in the rendered face")
        .required();
    command
        .option("--out", options->out,
                "output folder: codes.json, render.png, color.png (before | the part | after, with "
                "the part's mean colour and the target colour in the corners) and report.json")
        .required();
    ColorEditOptions& edit = options->edit;
    command
        .option("--term", options->term,
                "what is compared with the target colour: the part's mean colour, or each of its "
                "pixels as in the paper")
        .one_of({"mean", "pixels"});
    command.option("--steps", edit.steps, "optimiser steps").range(0, 1e6);
    command
        .option("--learning-rate", options->learning_rate,
                "learning rate of the first step (default: by the variation of the model's faces)")
        .range(0, 10);
    command.option("--decay", edit.decay, "factor on the learning rate after each step")
        .range(0, 1);
    command
        .option("--regularizer", options->regularizer,
                "weight of the squared code offset; negative: that of fits (default: by the "
                "variation of the model's faces)")
        .range(-1, 1e6);
    command.option("--rest-weight", edit.rest_weight, "weight of the change outside the part")
        .range(0, 1e6);
    command.option("--samples", options->samples, "samples per ray (default: the model's setting)")
        .range(2, 4096);
}

}  // namespace stymo
