#include <gif_lib.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <memory>
#include <new>
#include <opencv2/core.hpp>

#include "core/error.h"
#include "core/io/image_bytes.h"

namespace stymo {
namespace {

using RgbBytes = std::vector<std::uint8_t>;  ///< RGB

constexpr int palette_size = 256;
/// Marks pixels that stay as they were; all others are colours.
constexpr int transparent = 255;
constexpr std::size_t all_colors = std::size_t{1} << 24;

std::size_t code_of(const std::uint8_t* pixel) {
    return static_cast<std::size_t>(pixel[0] << 16 | pixel[1] << 8 | pixel[2]);
}

cv::Vec3f color_of(std::size_t code) {
    return {static_cast<float>(code >> 16), static_cast<float>(code >> 8 & 255),
            static_cast<float>(code & 255)};
}

/// Colours to cluster: the means of cells of colour space, each as often as the square root of its
/// pixels, so that a small part of another hue, such as an iris, keeps colours of its own.
std::vector<cv::Vec3f> samples_of(const std::vector<RgbBytes>& frames) {
    constexpr std::size_t cells = std::size_t{1} << 18;
    constexpr double wanted = 16384.0;
    std::vector<cv::Vec3d> sums(cells);
    std::vector<double> counts(cells);
    for (const RgbBytes& frame : frames)
        for (std::size_t i = 0; i < frame.size(); i += 3) {
            const std::size_t cell = static_cast<std::size_t>(
                frame[i] >> 2 << 12 | frame[i + 1] >> 2 << 6 | frame[i + 2] >> 2);
            sums[cell] += cv::Vec3d(frame[i], frame[i + 1], frame[i + 2]);
            counts[cell] += 1.0;
        }
    double roots = 0.0;
    for (const double count : counts) roots += std::sqrt(count);
    std::vector<cv::Vec3f> samples;
    for (std::size_t cell = 0; cell < cells; ++cell)
        if (counts[cell] > 0.0)
            samples.insert(
                samples.end(),
                static_cast<std::size_t>(std::ceil(std::sqrt(counts[cell]) / roots * wanted)),
                cv::Vec3f(sums[cell] / counts[cell]));
    return samples;
}

/// Restores the state of OpenCV's random numbers.
struct RestoreRandomState {
    RestoreRandomState() = default;
    ~RestoreRandomState() { cv::theRNG().state = former; }
    RestoreRandomState(const RestoreRandomState&) = delete;
    RestoreRandomState& operator=(const RestoreRandomState&) = delete;

    std::uint64_t former = cv::theRNG().state;
};

std::vector<cv::Vec3f> clustered(const std::vector<RgbBytes>& frames) {
    const std::vector<cv::Vec3f> samples = samples_of(frames);
    const cv::Mat rows(static_cast<int>(samples.size()), 3, CV_32F,
                       const_cast<cv::Vec3f*>(samples.data()));
    const cv::TermCriteria until(cv::TermCriteria::COUNT | cv::TermCriteria::EPS, 20, 0.1);
    cv::Mat labels, centers;
    // The same frames give the same bytes.
    const RestoreRandomState restore;
    cv::theRNG().state = 1;
    cv::kmeans(rows, std::min(transparent, rows.rows), labels, until, 1, cv::KMEANS_PP_CENTERS,
               centers);
    return {centers.ptr<cv::Vec3f>(), centers.ptr<cv::Vec3f>() + centers.rows};
}

/// The palette of a clip, and the nearest of its colours for every colour.
class Palette {
public:
    explicit Palette(const std::vector<RgbBytes>& frames) : index_(all_colors, unknown) {
        for (const RgbBytes& frame : frames)
            for (std::size_t i = 0; i < frame.size() && colors_.size() <= transparent; i += 3) {
                const std::size_t code = code_of(&frame[i]);
                if (std::exchange(index_[code], std::int16_t{0}) == unknown)
                    colors_.push_back(color_of(code));
            }
        if (colors_.size() > transparent) colors_ = clustered(frames);
        std::ranges::fill(index_, unknown);
    }

    GifByteType nearest(const std::uint8_t* pixel) {
        const std::size_t code = code_of(pixel);
        if (index_[code] == unknown) {
            const cv::Vec3f color = color_of(code);
            const auto distance = [&](const cv::Vec3f& entry) {
                const cv::Vec3f difference = entry - color;
                return difference.dot(difference);
            };
            index_[code] = static_cast<std::int16_t>(
                std::ranges::min_element(colors_, {}, distance) - colors_.begin());
        }
        return static_cast<GifByteType>(index_[code]);
    }

    [[nodiscard]] std::vector<GifColorType> entries() const {
        std::vector<GifColorType> result(palette_size);
        const auto byte = [](float value) { return cv::saturate_cast<GifByteType>(value); };
        for (std::size_t i = 0; i < colors_.size(); ++i)
            result[i] = {byte(colors_[i][0]), byte(colors_[i][1]), byte(colors_[i][2])};
        return result;
    }

private:
    static constexpr std::int16_t unknown = -1;
    std::vector<std::int16_t> index_;
    std::vector<cv::Vec3f> colors_;
};

int append_bytes(GifFileType* file, const GifByteType* bytes, int count) {
    try {
        static_cast<std::string*>(file->UserData)
            ->append(reinterpret_cast<const char*>(bytes), static_cast<std::size_t>(count));
        return count;
    } catch (const std::bad_alloc&) {
        return 0;  // no exception may pass through giflib
    }
}

struct CloseGif {
    void operator()(GifFileType* file) const { EGifCloseFile(file, nullptr); }
};

/// Writes a GIF through giflib.
class GifWriter {
public:
    GifWriter(int width, int height, const std::vector<GifColorType>& palette)
        : width_(width),
          height_(height),
          file_(EGifOpen(&bytes_, append_bytes, nullptr)),
          map_(GifMakeMapObject(palette_size, palette.data()), GifFreeMapObject) {
        if (!file_ || !map_) fail<FileError>("the GIF cannot be encoded");
        EGifSetGifVersion(file_.get(), true);
        require(EGifPutScreenDesc(file_.get(), width, height, 8, 0, map_.get()));
        const std::array<GifByteType, 3> endlessly{1, 0, 0};
        require(EGifPutExtensionLeader(file_.get(), APPLICATION_EXT_FUNC_CODE));
        require(EGifPutExtensionBlock(file_.get(), 11, "NETSCAPE2.0"));
        require(EGifPutExtensionBlock(file_.get(), 3, endlessly.data()));
        require(EGifPutExtensionTrailer(file_.get()));
    }

    void add(std::vector<GifByteType> indices, int hundredths) {
        const GraphicsControlBlock control{.DisposalMode = DISPOSE_DO_NOT,
                                           .UserInputFlag = false,
                                           .DelayTime = hundredths,
                                           .TransparentColor = transparent};
        std::array<GifByteType, 4> extension{};
        EGifGCBToExtension(&control, extension.data());
        require(EGifPutExtension(file_.get(), GRAPHICS_EXT_FUNC_CODE, 4, extension.data()));
        require(EGifPutImageDesc(file_.get(), 0, 0, width_, height_, false, nullptr));
        require(EGifPutLine(file_.get(), indices.data(), static_cast<int>(indices.size())));
    }

    std::string finish() {
        require(EGifCloseFile(file_.release(), nullptr));
        return std::move(bytes_);
    }

private:
    static void require(int status) {
        if (status != GIF_OK) fail<FileError>("the GIF cannot be encoded");
    }

    int width_, height_;
    std::string bytes_;
    std::unique_ptr<GifFileType, CloseGif> file_;
    std::unique_ptr<ColorMapObject, void (*)(ColorMapObject*)> map_;
};

}  // namespace

std::string gif_bytes(const std::vector<Tensor>& frames, double frames_per_second) {
    std::vector<RgbBytes> pixels;
    for (const Tensor& frame : frames) pixels.push_back(image_bytes(frame));
    Palette palette(pixels);
    GifWriter writer(static_cast<int>(frames[0].shape(1)), static_cast<int>(frames[0].shape(0)),
                     palette.entries());
    // GIF counts delays in hundredths of a second, and most viewers slow down delays below two of
    // them.
    const double delay = std::clamp(100.0 / frames_per_second, 2.0, 60000.0);
    double owed = 0.0;  // what rounding has left out
    std::vector<GifByteType> shown;
    for (const RgbBytes& frame : pixels) {
        std::vector<GifByteType> indices(frame.size() / 3);
        for (std::size_t i = 0; i < indices.size(); ++i)
            indices[i] = palette.nearest(&frame[3 * i]);
        const std::vector<GifByteType> former = std::exchange(shown, indices);
        if (!former.empty())
            std::ranges::transform(indices, former, indices.begin(),
                                   [](GifByteType now, GifByteType before) {
                                       return now == before ? GifByteType{transparent} : now;
                                   });
        const auto hundredths = static_cast<int>(std::lround(delay + owed));
        owed += delay - hundredths;
        writer.add(std::move(indices), hundredths);
    }
    return writer.finish();
}

}  // namespace stymo
