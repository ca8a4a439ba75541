#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <vector>

#include "core/tensor.h"

namespace stymo {

/// How a network wants its pixels: (x - mean) / deviation of x in [0, 1], channels red, green, blue or the other way round.
struct PixelScale {
    std::array<float, 3> mean;
    std::array<float, 3> deviation;
    bool blue_first = false;
};

/// A network from pictures to numbers, read from an ONNX file and run by OpenCV. Not to be called from several threads at once.
class OnnxNetwork {
public:
    struct Output {
        std::vector<std::int64_t> extents;  ///< as the network has them, channels before rows and columns
        std::vector<float> values;
    };

    /// Throws FileError for a file that is missing or not a network that OpenCV can run.
    explicit OnnxNetwork(const std::filesystem::path& onnx);
    ~OnnxNetwork();
    OnnxNetwork(OnnxNetwork&&) noexcept;
    OnnxNetwork& operator=(OnnxNetwork&&) noexcept;

    [[nodiscard]] std::size_t output_count() const;

    /// The first output for a picture (height, width, 3), RGB. Throws ShapeError for a size that the network does not take.
    [[nodiscard]] Output run(const Tensor& picture, const PixelScale& scale);

private:
    struct Implementation;
    std::unique_ptr<Implementation> implementation_;
};

}  // namespace stymo
