#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <vector>

#include "core/tensor.h"

namespace stymo {

/// The pixel values of a network's input: (x - mean) / deviation for x in [0, 1], in the order RGB
/// or BGR.
struct PixelScale {
    std::array<float, 3> mean;
    std::array<float, 3> deviation;
    bool blue_first = false;
};

/// A network from images to numbers, read from an ONNX file and run by OpenCV. Not thread-safe.
class OnnxNetwork {
public:
    struct Output {
        /// In the network's layout, channels before rows and columns.
        std::vector<std::int64_t> extents;
        std::vector<float> values;
    };

    /// Throws FileError for a file that is missing or not a network that OpenCV can run.
    explicit OnnxNetwork(const std::filesystem::path& onnx);
    ~OnnxNetwork();
    OnnxNetwork(OnnxNetwork&&) noexcept;
    OnnxNetwork& operator=(OnnxNetwork&&) noexcept;

    [[nodiscard]] std::size_t output_count() const;

    /// The first output for an image (height, width, 3), RGB. Throws ShapeError for a size that the
    /// network does not accept.
    [[nodiscard]] Output run(const Tensor& image, const PixelScale& scale);

private:
    struct Implementation;
    std::unique_ptr<Implementation> implementation_;
};

}  // namespace stymo
