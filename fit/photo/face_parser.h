#pragma once

#include <filesystem>
#include <memory>
#include <optional>

#include "core/tensor.h"

namespace stymo {

/// The input of a face parser and the order of its 19 classes.
enum class FaceParserKind {
    celebamask,            ///< input 256x256 RGB in [-1, 1]; CelebAMask-HQ's order of classes
    face_parsing_pytorch,  ///< BiSeNet of zllrunning/face-parsing.PyTorch: input 512x512,
                           ///< ImageNet's mean and deviation, its own order of classes
};

/// A network that segments the parts of a head, read from an ONNX file.
class FaceParser {
public:
    /// Without `kind`, a network that has several outputs or does not accept 256 pixels is
    /// face_parsing_pytorch, any other celebamask. Throws FileError for a file that is missing, not
    /// an ONNX network, or does not give 19 classes for each pixel.
    explicit FaceParser(const std::filesystem::path& onnx,
                        std::optional<FaceParserKind> kind = std::nullopt);
    ~FaceParser();
    FaceParser(FaceParser&&) noexcept;
    FaceParser& operator=(FaceParser&&) noexcept;

    [[nodiscard]] FaceParserKind kind() const;

    /// The classes of an aligned crop (side, side, 3) in [0, 1]: indices 0..18 of CelebAMask-HQ
    /// (render/parsing_classes.h), (side, side, 1). Not thread-safe, like the next function.
    [[nodiscard]] Tensor parse(const Tensor& crop);

    /// The classes of a head on black: background where `mask` (side, side, 1) is below one half,
    /// elsewhere the most likely class of a head (is_head_class). On black, networks mistake dark
    /// or blurred hair for background.
    [[nodiscard]] Tensor parse_head(const Tensor& crop, const Tensor& mask);

private:
    struct Implementation;
    std::unique_ptr<Implementation> implementation_;
};

}  // namespace stymo
