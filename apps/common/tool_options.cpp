#include "apps/common/tool_options.h"

#include <algorithm>
#include <iostream>
#include <system_error>

#include "core/error.h"
#include "nn/models/weight_changes.h"

namespace stymo {

namespace {

std::string network_called(const std::string& metric) {
    if (metric == "squeeze") return "squeezenet1_1";
    if (metric == "alex") return "alexnet";
    return metric;
}

LpipsConfig with_files(LpipsConfig config, const LpipsOptions& options) {
    if (!options.trunk.empty()) config.trunk = options.trunk;
    if (!options.heads.empty()) config.heads = options.heads;
    return config;
}

}  // namespace

void declare_model(Command& command, ModelOptions& options) {
    command.option(
        "--model", options.file,
        "model.safetensors of a training run, or faces-512: the model for 512 pixels that "
        "comes with stymo (default: faces-256, that for 256 pixels)");
}

void declare_tuned(Command& command, ModelOptions& options) {
    command.option("--tuned", options.tuned,
                   "tuned.safetensors of stymo-fit --tune: the weights of one face, for the same "
                   "model");
}

std::filesystem::path model_file(const ModelOptions& options) {
    std::filesystem::path file = named_model(options.file);
    if (!file.empty()) return file;
    fail<UsageError>("--model is required: no model lies beside this program");
}

Model load_model(const ModelOptions& options, ModelParts parts) {
    Model model = Model::load(model_file(options), parts);
    if (options.tuned.empty()) return model;
    const WeightChanges changes = WeightChanges::load(options.tuned);
    try {
        changes.apply(model);
    } catch (const ValueError& error) {
        fail<FileError>(options.tuned.string(), ": ", error.what());
    }
    return model;
}

std::string model_mark(const ModelOptions& options) {
    return model_mark(model_file(options));
}

CodeFile read_own_codes(const std::filesystem::path& file, const ModelOptions& options) {
    CodeFile face = read_code_file(file, model_mark(options));
    if (!options.tuned.empty() && !WeightChanges::load(options.tuned).are_of(face.codes))
        std::cerr << "warning: " << options.tuned.string() << " was tuned for another face than "
                  << file.string() << std::endl;
    return face;
}

void require_not_read(const std::filesystem::path& out,
                      const std::vector<std::filesystem::path>& inputs) {
    std::error_code missing;
    for (const std::filesystem::path& input : inputs) {
        if (std::filesystem::equivalent(input, out, missing))
            fail<UsageError>("--out: ", input.string(), ", which is read, would be replaced");
        if (std::filesystem::is_directory(input, missing) &&
            std::filesystem::equivalent(input, out.parent_path(), missing) &&
            std::filesystem::exists(out, missing))
            fail<UsageError>("--out: ", out.string(), " belongs to ", input.string(),
                             ", which is read");
    }
}

void declare_head(Command& command, std::filesystem::path& file, const std::string& purpose,
                  const std::string& otherwise) {
    command.option("--morphable", file,
                   "head model" + (purpose.empty() ? "" : " " + purpose) +
                       ": a .safetensors file or a folder of ICT-FaceKit (" + otherwise + ")");
}

void declare_preparation_files(Command& command, PhotoPreparationSettings& settings) {
    settings.mask_network = shipped_mask_network();
    command.option("--mask-net", settings.mask_network,
                   "network that finds head masks, written by stymo-train --head-mask (default: "
                   "the network that comes with stymo)");
    declare_landmark_files(command, settings);
    command
        .option("--max-pixels", settings.most_pixels,
                "unprepared photos with more pixels are refused")
        .range(1, 1e12);
}

void declare_landmark_files(Command& command, PhotoPreparationSettings& settings) {
    settings.landmark_model = shipped_landmark_network();
    declare_head(command, settings.morphable, "that is fitted for pose and codes");
    command.option(
        "--landmarks", settings.landmark_model,
        "predictor of 68 landmarks: a landmark network (.safetensors), or dlib's "
        "shape_predictor (default: the network that comes with stymo, else the model of Debian's "
        "libdlib-data)");
    command.option("--pose-net", settings.pose_network,
                   "pose network in an ONNX file, 3DDFA_V2 or 6DRepNet; its pose replaces that of "
                   "the fitted head, whose depth a fit is then not drawn to");
}

void warn_without_landmark_network(const PhotoPreparationSettings& settings) {
    if (settings.landmark_model.empty())
        std::cerr << "warning: the landmark network that comes with stymo was not found near the "
                     "program, so dlib's landmarks are used; name the network with --landmarks"
                  << std::endl;
}

void declare_lpips_metric(Command& command, LpipsOptions& options) {
    command.option("--lpips", options.metric, "also measure LPIPS, with this network")
        .one_of({"squeeze", "vgg16", "alex"});
}

void declare_lpips_files(Command& command, LpipsOptions& options) {
    command
        .option("--lpips-trunk", options.trunk,
                "weights of the network of LPIPS, written by stymo-weights import; random: "
                "untrained weights")
        .file_or("random");
    command
        .option("--lpips-heads", options.heads,
                "linear heads of LPIPS, written by stymo-weights import; random: all ones")
        .file_or("random");
}

void declare_perceptual_weight(Command& command, LpipsOptions& options) {
    command
        .option("--perceptual-network", options.perceptual_network,
                "network that compares images while fitting: one of LPIPS, or the model's own "
                "encoder, which needs no weight files (default: the model's setting)")
        .one_of({"encoder", "squeeze", "vgg16", "alex"});
    command
        .option("--perceptual-weight", options.perceptual_weight,
                "weight of the perceptual term while fitting (default: the model's setting)")
        .range(0, 1e6);
    command
        .option("--perceptual-resolution", options.perceptual_resolution,
                "largest side of the images that the perceptual term compares, 0: no limit "
                "(default: the model's setting)")
        .range(0, 4096);
}

LpipsConfig metric_config(const LpipsOptions& options, const LpipsConfig& model) {
    const std::string own =
        model.network == encoder_network ? network_called("squeeze") : model.network;
    const std::string network = options.metric.empty() ? own : network_called(options.metric);
    return with_files(network == model.network ? model : LpipsConfig{.network = network}, options);
}

ReconstructionConfig fitting_config(const LpipsOptions& options, ReconstructionConfig model) {
    if (options.perceptual_weight) model.perceptual_weight = *options.perceptual_weight;
    if (options.perceptual_resolution) model.perceptual_resolution = *options.perceptual_resolution;
    const std::string network = network_called(options.perceptual_network);
    if (!network.empty() && network != model.perceptual.network)
        model.perceptual = {.network = network};
    const LpipsConfig metric = metric_config(options, model.perceptual);
    if (metric.network == model.perceptual.network) model.perceptual = metric;
    return model;
}

std::vector<std::string> render_mode_names() {
    std::vector<std::string> names;
    for (const RenderModeTraits& mode : render_modes()) names.emplace_back(mode.name);
    return names;
}

std::string render_mode_help() {
    std::string help;
    for (const RenderModeTraits& mode : render_modes()) {
        if (!help.empty()) help += "; ";
        help.append(mode.name).append(": ").append(mode.help);
    }
    return help;
}

RenderMode render_mode(const std::string& name) {
    return std::ranges::find(render_modes(), name, &RenderModeTraits::name)->mode;
}

CodeGroups parse_code_groups(const std::string& list) {
    try {
        return code_groups_of(list);
    } catch (const ValueError& error) {
        fail<UsageError>("--take ", list, ": ", error.what());
    }
}

void require_extension(const std::filesystem::path& path,
                       std::initializer_list<const char*> extensions) {
    if (std::ranges::find(extensions, path.extension().string()) != extensions.end()) return;
    std::string list;
    for (const char* extension : extensions)
        list += (list.empty() ? "" : " or ") + std::string(extension);
    fail<UsageError>(path.string(), ": the name must end in ", list);
}

void require_folder_of(const std::filesystem::path& path) {
    std::error_code ignored;
    if (std::filesystem::is_directory(path, ignored))
        fail<FileError>(path.string(), ": is a folder; give the name of a file");
    require_writable_folder(path.parent_path().empty() ? std::filesystem::path(".")
                                                       : path.parent_path());
}

}  // namespace stymo
