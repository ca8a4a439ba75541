#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "fit/edit/style_mix.h"
#include "fit/face_mesh.h"
#include "fit/fit_job.h"
#include "nn/realtime/face_renderer.h"

namespace stymo {

/// A face as a model knows it. Copies share the tuned decoder.
struct StudioFace {
    CodeFile face;                         ///< codes and pose
    std::shared_ptr<const Model> tuned{};  ///< the decoder of this face alone; null: the model's
    std::shared_ptr<const WeightChanges> changes{};  ///< of the tuned decoder
    /// The prepared photo, for tuning, and the PSNR of the rendered face against it in decibels;
    /// empty unless the face was fitted here.
    std::optional<Face> photo{};
    std::optional<double> psnr{};
    std::vector<std::string> warnings{};
    /// The head whose depth tuning keeps, as FitJobOptions::head of the fit.
    std::optional<std::filesystem::path> head{};
};

/// How a face is looked at.
struct StudioView {
    /// Degrees; positive yaw turns the face to the image's left. Without any, the face's own pose.
    std::optional<double> yaw{}, pitch{}, roll{};
    RendererOptions options{.mode = RenderMode::exact};
    /// The image as the decoder draws it, without the soft edge of render/soft_edge.h.
    bool raw = false;
};

/// A model with all that leads from a photo to a rendered face: for programs that embed stymo, and
/// for its C and Python interfaces. Threads may use one Studio at the same time; they share one
/// renderer, one after the other. While it works, subnormal numbers are flushed to zero.
class Studio {
public:
    /// Reads the model that `named_model` finds: a file, "faces-512", or faces-256 without a name.
    /// `configs` is the folder of an installation that has this model and the networks for photos,
    /// share/stymo/configs; empty: it is searched for (shipped_files.h). Throws FileError.
    explicit Studio(std::filesystem::path model = {}, std::filesystem::path configs = {});
    ~Studio();
    Studio(Studio&&) noexcept;
    Studio& operator=(Studio&&) noexcept;

    [[nodiscard]] const Model& model() const;
    /// The options of `fit`: those of stymo-fit, with the networks that come with stymo.
    [[nodiscard]] FitJobOptions fit_options() const;

    /// Finds the clearest face of a photo, (height, width, 3) in [0, 1], and fits the codes to it;
    /// also tunes, if the options say so. Throws ValueError for values outside [0, 1],
    /// FileError if there is no face that can be used, and what FitJob throws. After an interrupt
    /// the face has what was reached, and a warning.
    [[nodiscard]] StudioFace fit(const Tensor& photo, const FitJobOptions& options,
                                 const FitObserver& observer = {}) const;
    [[nodiscard]] StudioFace fit(const Tensor& photo) const { return fit(photo, fit_options()); }
    /// Tunes the model's decoder to a face that `fit` returned, until `seconds` or `steps` are
    /// over, whichever comes first; 0: no such limit. A face that is tuned already is returned with
    /// a warning if the new tuning, which begins anew, ends with a lower PSNR. Throws ValueError
    /// for another face, and without a limit.
    [[nodiscard]] StudioFace tune(const StudioFace& face, double seconds, std::int64_t steps = 0,
                                  const FitObserver& observer = {}) const;

    /// Renders a face. Throws ValueError for angles that are not finite, and what FaceRenderer
    /// throws.
    [[nodiscard]] View render(const StudioFace& face, const StudioView& view = {}) const;

    /// The face as a mesh with the topology of the built-in head. Throws ValueError for a texture
    /// side that is no power of two from 64 to 8192, FileError without a landmark network, and what
    /// `face_mesh` throws.
    [[nodiscard]] FaceMesh mesh(const StudioFace& face, std::int64_t texture_side = 1024,
                                bool neutral = false) const;

    /// A new face from the distribution of the training faces, seen from the front: number `index`
    /// of `stymo-render --sample --seed S`. Throws ValueError if the model has no statistics.
    [[nodiscard]] StudioFace sample(std::uint64_t seed, std::uint64_t index = 0,
                                    double truncation = 0.7) const;
    /// Reads what stymo-fit writes: codes.json and, unless the path is empty, tuned.safetensors.
    /// Throws FileError for codes that are marked as another model's.
    [[nodiscard]] StudioFace read(const std::filesystem::path& codes,
                                  const std::filesystem::path& tuned = {}) const;

private:
    struct State;
    std::unique_ptr<State> state_;
};

/// The pixels of an 8-bit image in [0, 1], to the bit as read_image reads them from a file. Throws
/// ShapeError if there are not as many as the shape has.
[[nodiscard]] Tensor tensor_from_bytes(std::span<const std::uint8_t> pixels, const Shape& shape);

/// The target with the groups `take` ("expr,tex") of the source; it keeps its pose and decoder.
/// Throws ValueError for an unknown group and for faces of two models.
[[nodiscard]] StudioFace mix(const StudioFace& target, const StudioFace& source,
                             const std::string& take);
/// Writes the files that `Studio::read` reads. Throws ValueError if `tuned` is given for a face
/// that is not tuned, FileError.
void write(const StudioFace& face, const std::filesystem::path& codes,
           const std::filesystem::path& tuned = {});

}  // namespace stymo
