#include "fit/photo/onnx_network.h"

#include <opencv2/core/utils/logger.hpp>
#include <opencv2/dnn.hpp>
#include <string>

#include "core/error.h"
#include "core/io/file.h"

namespace stymo {
namespace {

/// OpenCV prints on stderr why it refuses a network, but an error of the tools is a single line.
class QuietOpenCv {
public:
    QuietOpenCv()
        : former_(cv::utils::logging::setLogLevel(cv::utils::logging::LOG_LEVEL_SILENT)) {}
    ~QuietOpenCv() { cv::utils::logging::setLogLevel(former_); }
    QuietOpenCv(const QuietOpenCv&) = delete;
    QuietOpenCv& operator=(const QuietOpenCv&) = delete;

private:
    cv::utils::logging::LogLevel former_;
};

cv::Mat planes_of(const Tensor& image, const PixelScale& scale) {
    const std::array<int, 4> extents = {1, 3, static_cast<int>(image.shape(0)),
                                        static_cast<int>(image.shape(1))};
    cv::Mat planes(4, extents.data(), CV_32F);
    const std::span<const float> pixels = image.values<float>();
    const std::size_t plane = pixels.size() / 3;
    auto* const values = planes.ptr<float>();
    for (std::size_t channel = 0; channel < 3; ++channel) {
        const std::size_t source = scale.blue_first ? 2 - channel : channel;
        for (std::size_t i = 0; i < plane; ++i)
            values[channel * plane + i] =
                (pixels[3 * i + source] - scale.mean[source]) / scale.deviation[source];
    }
    return planes;
}

}  // namespace

struct OnnxNetwork::Implementation {
    cv::dnn::Net network;
    std::vector<std::string> outputs;
};

OnnxNetwork::OnnxNetwork(const std::filesystem::path& onnx)
    : implementation_(std::make_unique<Implementation>()) {
    const std::string bytes = read_file(onnx);
    const QuietOpenCv quiet;
    try {
        implementation_->network = cv::dnn::readNetFromONNX(bytes.data(), bytes.size());
        implementation_->outputs = implementation_->network.getUnconnectedOutLayersNames();
    } catch (const cv::Exception&) {
        fail<FileError>(onnx.string(), ": not an ONNX network that OpenCV can run");
    }
    if (implementation_->outputs.empty())
        fail<FileError>(onnx.string(), ": a network without outputs");
}

OnnxNetwork::~OnnxNetwork() = default;
OnnxNetwork::OnnxNetwork(OnnxNetwork&&) noexcept = default;
OnnxNetwork& OnnxNetwork::operator=(OnnxNetwork&&) noexcept = default;

std::size_t OnnxNetwork::output_count() const {
    return implementation_->outputs.size();
}

OnnxNetwork::Output OnnxNetwork::run(const Tensor& image, const PixelScale& scale) {
    const QuietOpenCv quiet;
    try {
        implementation_->network.setInput(planes_of(image, scale));
        const cv::Mat result = implementation_->network.forward(implementation_->outputs.front());
        Output output{{}, {result.ptr<float>(), result.ptr<float>() + result.total()}};
        for (int axis = 0; axis < result.dims; ++axis) output.extents.push_back(result.size[axis]);
        return output;
    } catch (const cv::Exception&) {
        fail<ShapeError>("the network does not take images of ", image.shape(1), " x ",
                         image.shape(0), " pixels");
    }
}

}  // namespace stymo
