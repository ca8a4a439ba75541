#include "fit/photo/onnx_network.h"

#include <algorithm>
#include <mutex>
#include <opencv2/core/utils/logger.hpp>
#include <opencv2/dnn.hpp>
#include <regex>
#include <string>

#include "core/error.h"
#include "core/io/file.h"
#include "core/io/onnx_file.h"

namespace stymo {
namespace {

/// OpenCV prints on stderr why it refuses a network, but an error of the tools is a single line.
class QuietOpenCv {
public:
    QuietOpenCv() {
        const std::lock_guard lock(mutex_);
        if (living_++ == 0)
            former_ = cv::utils::logging::setLogLevel(cv::utils::logging::LOG_LEVEL_SILENT);
    }
    ~QuietOpenCv() {
        const std::lock_guard lock(mutex_);
        if (--living_ == 0) cv::utils::logging::setLogLevel(former_);
    }
    QuietOpenCv(const QuietOpenCv&) = delete;
    QuietOpenCv& operator=(const QuietOpenCv&) = delete;

private:
    // The level is the process's, and networks run on several threads at once.
    inline static std::mutex mutex_;
    inline static int living_ = 0;
    inline static cv::utils::logging::LogLevel former_ = cv::utils::logging::LOG_LEVEL_SILENT;
};

/// What OpenCV says is wrong, in one line.
std::string reason_of(const std::exception& error) {
    const auto* known = dynamic_cast<const cv::Exception*>(&error);
    std::string reason = known != nullptr ? known->err : error.what();
    reason.resize(std::min({reason.find('\n'), reason.size(), std::size_t{300}}));
    // A message inside another one names the line of OpenCV's sources.
    static const std::regex prefix(R"(^> |OpenCV\([^)]*\) \S+: error: )");
    return "OpenCV: " + std::regex_replace(reason, prefix, "");
}

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
    std::vector<std::int64_t> input;  ///< extents, 0 where any number will do

    /// OpenCV computes with the extents that the file declares, and writes beyond those of another
    /// image.
    void require_size(const Tensor& image) const {
        const std::array<std::int64_t, 4> given{1, 3, image.shape(0), image.shape(1)};
        if (!std::ranges::equal(given, input, [](std::int64_t value, std::int64_t declared) {
                return declared == 0 || declared == value;
            }))
            fail<ShapeError>("the network does not take images of ", image.shape(1), " x ",
                             image.shape(0), " pixels; its input is ", Shape(input));
    }
};

OnnxNetwork::OnnxNetwork(const std::filesystem::path& onnx)
    : implementation_(std::make_unique<Implementation>()) {
    if (!read_beginning(onnx, 1).starts_with('\x08'))
        fail<FileError>(onnx.string(), ": not an ONNX network");
    // OpenCV's own reader does not survive every file.
    const auto [bytes, input] = read_plain_onnx(onnx);
    implementation_->input = input;
    const QuietOpenCv quiet;
    try {
        implementation_->network = cv::dnn::readNetFromONNX(bytes.data(), bytes.size());
        implementation_->outputs = implementation_->network.getUnconnectedOutLayersNames();
    } catch (const std::exception& error) {
        fail<FileError>(onnx.string(), ": not an ONNX network that OpenCV can run (",
                        reason_of(error), ")");
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
    implementation_->require_size(image);
    const QuietOpenCv quiet;
    try {
        implementation_->network.setInput(planes_of(image, scale));
        const cv::Mat result = implementation_->network.forward(implementation_->outputs.front());
        if (result.type() != CV_32F) CV_Error(cv::Error::StsBadArg, "the output is not float32");
        Output output{{}, {result.ptr<float>(), result.ptr<float>() + result.total()}};
        for (int axis = 0; axis < result.dims; ++axis) output.extents.push_back(result.size[axis]);
        return output;
    } catch (const std::exception& error) {
        fail<ShapeError>("the network does not run on images of ", image.shape(1), " x ",
                         image.shape(0), " pixels; ", reason_of(error));
    }
}

}  // namespace stymo
