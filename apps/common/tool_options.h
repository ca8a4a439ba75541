#pragma once

#include <cstdint>
#include <filesystem>
#include <initializer_list>
#include <optional>
#include <string>
#include <vector>

#include "apps/common/command_line.h"
#include "fit/edit/style_mix.h"
#include "fit/photo/photo_preparation.h"
#include "fit/shipped_files.h"
#include "nn/models/model.h"
#include "nn/realtime/render_mode.h"

/// Options that several tools have, and what their values mean.
namespace stymo {

/// The model of a tool, with the changes of its weights for a tuned face.
struct ModelOptions {
    std::filesystem::path file;   ///< as for `named_model`
    std::filesystem::path tuned;  ///< file written by `stymo-fit --tune`; empty: none
};

/// Declares --model.
void declare_model(Command& command, ModelOptions& options);
/// Declares --tuned.
void declare_tuned(Command& command, ModelOptions& options);

/// The file of --model, or of the model that is shipped with stymo. Throws UsageError if there is
/// neither.
[[nodiscard]] std::filesystem::path model_file(const ModelOptions& options);
/// Loads that model and applies the changes of --tuned. Throws what Model::load and WeightChanges
/// throw.
[[nodiscard]] Model load_model(const ModelOptions& options, ModelParts parts = ModelParts::all);

/// What the codes of that model are marked with.
[[nodiscard]] std::string model_mark(const ModelOptions& options);
/// Reads a code file. Throws FileError, too, if it is marked with another model.
[[nodiscard]] CodeFile read_own_codes(const std::filesystem::path& file,
                                      const ModelOptions& options);

/// Throws UsageError if to write `out` would replace one of these files, or a file in one of these
/// folders, which the tool reads.
void require_not_read(const std::filesystem::path& out,
                      const std::vector<std::filesystem::path>& inputs);

/// Declares --morphable, a head model `purpose` ("whose topology the mesh has"; may be empty).
void declare_head(Command& command, std::filesystem::path& file, const std::string& purpose,
                  const std::string& otherwise = "default: the built-in head");

/// Declares --mask-net, --max-pixels and declare_landmark_files, for the preparation of photos.
void declare_preparation_files(Command& command, PhotoPreparationSettings& settings);
/// Declares --morphable, --landmarks and --pose-net.
void declare_landmark_files(Command& command, PhotoPreparationSettings& settings);
/// Prints a warning if the landmark network that comes with stymo was not found and no other was
/// named, because the shipped model fits photos worse if dlib's landmarks aligned them.
void warn_without_landmark_network(const PhotoPreparationSettings& settings);

/// The options for LPIPS. Options that are not given keep the model's settings.
struct LpipsOptions {
    std::string metric;  ///< network of the metric, "squeeze", "vgg16" or "alex"; empty: no metric
    /// Network of the perceptual term of fitting, or "encoder"; empty: the model's.
    std::string perceptual_network{};
    std::optional<double> perceptual_weight;            ///< weight of the perceptual term
    std::optional<std::int64_t> perceptual_resolution;  ///< resolution of the perceptual term
    std::string trunk;
    std::string heads;
};

/// Declares --lpips.
void declare_lpips_metric(Command& command, LpipsOptions& options);
/// Declares --lpips-trunk and --lpips-heads.
void declare_lpips_files(Command& command, LpipsOptions& options);
/// Declares --perceptual-network, --perceptual-weight and --perceptual-resolution.
void declare_perceptual_weight(Command& command, LpipsOptions& options);

/// The network of the metric with its files: from the command line, or from the model if it uses
/// the same network.
[[nodiscard]] LpipsConfig metric_config(const LpipsOptions& options, const LpipsConfig& model);
/// The model's reconstruction loss with the perceptual network, weight and resolution of the
/// command line, and with the files of the command line if they belong to the same network.
[[nodiscard]] ReconstructionConfig fitting_config(const LpipsOptions& options,
                                                  ReconstructionConfig model);

/// The values of --mode: the names of all modes.
[[nodiscard]] std::vector<std::string> render_mode_names();
/// What each mode does, in the help of --mode.
[[nodiscard]] std::string render_mode_help();
/// The mode with one of these names.
[[nodiscard]] RenderMode render_mode(const std::string& name);

/// Parses the value of --take, a list such as "expr,tex". Throws UsageError for an unknown name.
[[nodiscard]] CodeGroups parse_code_groups(const std::string& list);

/// Throws UsageError unless the file's name ends in one of `extensions` (".png"). Tools call this
/// before they begin to work.
void require_extension(const std::filesystem::path& path,
                       std::initializer_list<const char*> extensions);
/// Creates the parent folder of `path`. Throws FileError if that fails, or if `path` is a folder.
void require_folder_of(const std::filesystem::path& path);

}  // namespace stymo
