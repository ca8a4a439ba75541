#include <algorithm>
#include <cmath>
#include <filesystem>
#include <iomanip>
#include <sstream>

#include "apps/common/command_line.h"
#include "apps/common/table.h"
#include "apps/common/tool_options.h"
#include "apps/common/tools.h"
#include "apps/weights/derived_models.h"
#include "nn/pretrained/weights_import.h"

namespace {

namespace fs = std::filesystem;

std::int64_t value_count(const stymo::TensorFile& file) {
    std::int64_t count = 0;
    for (const auto& [name, tensor] : file.tensors) count += tensor.size();
    return count;
}

stymo::AppResult import(const fs::path& in, const fs::path& out) {
    stymo::require_extension(out, {".safetensors"});
    stymo::require_not_read(out, {in});
    const stymo::ImportedWeights weights = stymo::import_weights(in);
    stymo::require_folder_of(out);
    stymo::write_tensor_file(out, weights.file);
    const std::int64_t values = value_count(weights.file);
    return {
        stymo::text_from(out.string(), ": ",
                         weights.recognised.empty() ? "no network known here, names as they were"
                                                    : weights.recognised,
                         ", ", weights.file.tensors.size(), " tensors, ", values, " values\n"),
        stymo::JsonValue::object({{"written", out.string()},
                                  {"recognised", weights.recognised},
                                  {"tensors", weights.file.tensors.size()},
                                  {"values", values}})};
}

stymo::AppResult written(const fs::path& out) {
    const auto bytes = static_cast<std::int64_t>(fs::file_size(out));
    return {out.string() + ": " + std::to_string(bytes) + " bytes\n",
            stymo::JsonValue::object({{"written", out.string()}, {"bytes", bytes}})};
}

stymo::AppResult widen(const fs::path& in, const fs::path& out,
                       const std::vector<std::string>& settings) {
    stymo::require_extension(out, {".safetensors"});
    if (settings.empty())
        stymo::fail<stymo::UsageError>(
            "widen needs --set, such as --set decoder.field_width=192 (stymo-weights widen "
            "--help)");
    stymo::require_folder_of(out);
    stymo::require_not_read(out, {in});
    stymo::widen_model(in, out, settings);
    return written(out);
}

stymo::AppResult publish(const fs::path& in, const fs::path& out) {
    stymo::require_extension(out, {".safetensors"});
    stymo::require_folder_of(out);
    stymo::require_not_read(out, {in});
    stymo::publish_model(in, out);
    return written(out);
}

double norm(const stymo::Tensor& tensor) {
    double squares = 0.0;
    stymo::dispatch(tensor.dtype(), [&](auto zero) {
        for (const auto value : tensor.values<decltype(zero)>())
            squares += static_cast<double>(value) * static_cast<double>(value);
    });
    return std::sqrt(squares);
}

stymo::AppResult show(const fs::path& path) {
    const stymo::TensorFile file = stymo::read_weight_file(path);
    std::size_t width = 0;
    for (const auto& [name, tensor] : file.tensors) width = std::max(width, name.size());
    std::ostringstream text;
    std::vector<stymo::JsonValue> rows;
    for (const auto& [name, tensor] : file.tensors) {
        text << std::left << std::setw(static_cast<int>(width)) << name << "  " << tensor.dtype()
             << "  " << std::setw(20) << stymo::text_from(tensor.shape()) << "  norm "
             << norm(tensor) << "\n";
        rows.push_back(stymo::JsonValue::object({{"name", name},
                                                 {"shape", tensor.shape().extents()},
                                                 {"type", stymo::text_from(tensor.dtype())},
                                                 {"norm", norm(tensor)}}));
    }
    const std::int64_t values = value_count(file);
    text << file.tensors.size() << " tensors, " << values << " values\n";
    return {text.str(), stymo::JsonValue::object({{"tensors", rows}, {"values", values}})};
}

}  // namespace

int stymo_weights(int argc, char** argv) {
    fs::path in;
    fs::path out;
    fs::path shown;
    std::vector<std::string> settings;
    stymo::CommandLine line(
        "stymo-weights", "Imports weights of other programs: .safetensors, .onnx, PyTorch's .pth.");
    stymo::Command import_command = line.command(
        "import", "Converts the weights of a published network to the form that the tools read.",
        [&](const stymo::CommonOptions&) { return import(in, out); });
    import_command.option("in", in, "weights in any of the three formats").required();
    import_command.option("out", out, "output file, .safetensors").required();
    stymo::Command show_command = line.command(
        "show",
        "Lists names, types, shapes and norms; integers and 16-bit floats are read as float32.",
        [&](const stymo::CommonOptions&) { return show(shown); });
    show_command.option("file", shown, "weights in any of the three formats").required();
    stymo::Command publish_command = line.command(
        "publish",
        "Makes a model file for other people: 16-bit numbers, no paths of weight files, fitting "
        "without LPIPS.",
        [&](const stymo::CommonOptions&) { return publish(in, out); });
    publish_command.option("in", in, "model.safetensors of a training run").required();
    publish_command.option("out", out, "output file, .safetensors").required();
    stymo::Command widen_command = line.command(
        "widen",
        "Makes a model with more channels or pixels that renders the same images, to train it "
        "further.",
        [&](const stymo::CommonOptions&) { return widen(in, out, settings); });
    widen_command.option("in", in, "model.safetensors of a training run, or a published one")
        .required();
    widen_command.option("out", out, "output file, .safetensors").required();
    widen_command.option(
        "--set", settings,
        "decoder.field_width=192, .feature_channels, .block_channels, "
        ".mask_channels or .resolution (one more of .block_channels and of "
        "reconstruction.resolution_weights each time it doubles); encoder.backbone, "
        ".identity_backbone, .identity_from_both, .expression_backbone or .corrections; may be "
        "repeated");
    return line.run(argc, argv);
}
