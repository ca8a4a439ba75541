#include "apps/edit/color.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <iomanip>
#include <sstream>

#include "core/clock.h"
#include "core/interrupt.h"
#include "core/io/file.h"
#include "core/io/image.h"
#include "core/progress.h"
#include "fit/edit/part_mask.h"
#include "fit/photo/face_parser.h"
#include "nn/models/code_file.h"
#include "nn/models/picture.h"
#include "nn/models/view.h"

namespace stymo {

namespace {

/// "#a03020" as RGB in [0, 1].
Vector3 color_of(const std::string& text) {
    Vector3 color{};
    const bool shaped = text.size() == 7 && text.front() == '#';
    for (std::size_t channel = 0; channel < 3; ++channel) {
        int value = 0;
        const char* digits = text.data() + 1 + 2 * channel;
        if (!shaped || std::from_chars(digits, digits + 2, value, 16).ptr != digits + 2 || value < 0)
            fail<UsageError>("--color ", text, ": give six hexadecimal digits, such as '#a03020'");
        color[channel] = value / 255.0;
    }
    return color;
}

std::string text_of(const Vector3& color) {
    std::ostringstream text;
    text << '#' << std::hex << std::setfill('0');
    for (const double channel : color) text << std::setw(2) << std::lround(255.0 * std::clamp(channel, 0.0, 1.0));
    return text.str();
}

/// "hair", "lips", "skin+nose".
HeadPartSet parts_of(const std::string& text) {
    HeadPartSet parts{};
    const auto add = [&](const std::string& name) {
        const auto found = std::ranges::find(head_part_names, name);
        if (found == head_part_names.end()) {
            std::string names;
            for (const char* known : head_part_names) names += std::string(names.empty() ? "" : ", ") + known;
            fail<UsageError>("--part ", text, ": \"", name, "\" is no part of a head; there are lips, ", names);
        }
        parts[static_cast<std::size_t>(found - head_part_names.begin())] = true;
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

/// The picture with a square of one colour in its upper right corner.
Tensor with_patch(Tensor picture, const Vector3& color) {
    const std::int64_t side = picture.shape(1);
    const std::int64_t patch = std::max<std::int64_t>(side / 6, 1);
    const std::span<float> values = picture.mutable_values<float>();
    for (std::int64_t y = 0; y < patch; ++y)
        for (std::int64_t x = side - patch; x < side; ++x)
            for (std::int64_t channel = 0; channel < 3; ++channel)
                values[static_cast<std::size_t>((y * side + x) * 3 + channel)] =
                    static_cast<float>(color[static_cast<std::size_t>(channel)]);
    return picture;
}

/// Where the edit is wanted, and where none is.
struct Regions {
    Tensor part;
    Tensor rest;       ///< everything else
    Tensor head_rest;  ///< of it, the head
};

Regions regions_of(const Tensor& classes, const HeadPartSet& parts) {
    HeadPartSet rest{};
    HeadPartSet head_rest{};
    const HeadPartSet head = head_of_parts();
    for (std::size_t i = 0; i < parts.size(); ++i) {
        rest[i] = !parts[i];
        head_rest[i] = head[i] && !parts[i];
    }
    return {part_mask(classes, parts), part_mask(classes, rest), part_mask(classes, head_rest)};
}

std::int64_t pixels_of(const Tensor& mask) {
    return std::ranges::count(mask.values<float>(), 1.0F);
}

struct ColorReport {
    JsonValue json;
    std::string text;
};

ColorReport report_of(const ColorOptions& options, const ColorEdit& edit, const Regions& regions, double seconds) {
    const Vector3 target = color_of(options.color);
    const Vector3 before = mean_color(edit.before, regions.part);
    const Vector3 after = mean_color(edit.after, regions.part);
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
    std::ostringstream text;
    text << options.part << ": " << text_of(before) << " -> " << text_of(after) << ", wanted " << text_of(target) << '\n'
         << std::fixed << std::setprecision(1) << 100.0 * share << " % of the way\n"
         << std::setprecision(4) << "outside of it L1 " << rest << " (mean over RGB), in the head " << head_rest << '\n'
         << std::setprecision(1) << seconds << " s\n";
    return {json, text.str()};
}

AppResult color(ColorOptions options) {
    const Vector3 target = color_of(options.color);
    const HeadPartSet parts = parts_of(options.part);
    options.edit.term = options.term == "pixels" ? ColorTerm::pixels : ColorTerm::mean;
    const Model model = Model::load(options.model);
    options.edit.samples_per_ray = options.samples.value_or(model.config().reconstruction.fit_samples_per_ray);
    const CodeFile face = read_code_file(options.codes);
    FaceParser parser(options.parser);
    const Camera camera = camera_from_pose(face.pose, model.config().camera.intrinsics);
    const View view = render_view(model, face.codes, 0, camera, {.samples_per_ray = options.edit.samples_per_ray, .mask = true});
    const Regions regions = regions_of(parser.parse_head(view.picture, view.mask), parts);
    if (pixels_of(regions.part) == 0)
        fail<ValueError>(options.codes.string(), ": the parser finds no ", options.part,
                         " on the rendered face; choose another --part or --parser");
    require_writable_folder(options.out);

    const InterruptGuard guard;
    Progress progress({.title = "color", .total = options.edit.steps, .unit = "steps"});
    options.edit.on_step = [&](std::int64_t step, double loss) { progress.update(step, "loss " + std::to_string(loss)); };
    const double start = seconds_now();
    const ColorEdit edit = edit_color(model, face.codes, camera, regions.part, target, options.edit);
    const double seconds = seconds_now() - start;
    progress.finish();

    const ColorReport report = report_of(options, edit, regions, seconds);
    write_image(options.out / "color.png", tile_images({with_patch(edit.before, mean_color(edit.before, regions.part)),
                                                        with_patch(masked_picture(edit.before, regions.part), target),
                                                        with_patch(edit.after, mean_color(edit.after, regions.part))},
                                                       3));
    write_image(options.out / "render.png", edit.after);
    write_code_file(options.out / "codes.json", edit.codes, 0, face.pose);
    write_text_file(options.out / "report.json", report.json.text() + "\n");
    AppResult result{report.text, report.json};
    const std::int64_t steps = std::ssize(edit.losses);
    if (steps < options.edit.steps)
        result.incomplete = "interrupted after " + std::to_string(steps) + " of " + std::to_string(options.edit.steps) + " steps";
    return result;
}

}  // namespace

void declare_color(CommandLine& line, ColorOptions& options) {
    Command command = line.command("color", "Gives a part of a fitted face another colour and leaves the rest as it is.",
                                   [&options](const CommonOptions&) { return color(options); });
    command.option("--model", options.model, "model.safetensors of a training run").required();
    command.option("--codes", options.codes, "codes.json of a fit").required();
    command.option("--part", options.part, "hair, skin, lips, or any class of CelebAMask-HQ, or several joined with +")
        .required();
    command.option("--color", options.color, "wanted, such as '#a03020'").required();
    command.option("--parser", options.parser, "face-parsing network, an ONNX file; finds the part on the rendered face")
        .required();
    command
        .option("--out", options.out,
                "folder for codes.json, render.png, color.png (before | the part | after; in the corners the part's mean colour "
                "and the wanted one) and report.json")
        .required();
    ColorEditOptions& edit = options.edit;
    command.option("--term", options.term, "what is to have the colour: the part's mean, or each of its pixels as in the paper")
        .one_of({"mean", "pixels"});
    command.option("--steps", edit.steps, "optimiser steps").range(0, 1e6);
    command.option("--learning-rate", edit.learning_rate, "of the first step").range(0, 10);
    command.option("--decay", edit.decay, "factor on the learning rate after each step").range(0, 1);
    command.option("--regularizer", edit.regularizer, "weight of the squared code offset; negative: the model's own")
        .range(-1, 1e6);
    command.option("--rest-weight", edit.rest_weight, "weight of what changes outside of the part").range(0, 1e6);
    command.option("--samples", options.samples, "samples per ray; the model's own unless given").range(2, 4096);
}

}  // namespace stymo
