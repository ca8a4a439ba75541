#include "core/io/film.h"

extern "C" {
#include <libavcodec/avcodec.h>
#include <libavformat/avformat.h>
}

#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <fstream>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <opencv2/videoio.hpp>
#include <string_view>
#include <vector>

#include "core/error.h"
#include "core/io/file.h"
#include "core/io/image_bytes.h"

namespace stymo {
namespace {

namespace fs = std::filesystem;

std::uint64_t big_endian(std::string_view bytes) {
    std::uint64_t value = 0;
    for (const char byte : bytes) value = value << 8 | static_cast<unsigned char>(byte);
    return value;
}

/// Whether an MP4 file consists of whole boxes, one of which is the index of the film. The encoder
/// does not say when the disk refuses a part of the file.
bool is_whole_mp4(const fs::path& path) {
    constexpr std::uint64_t header = 8;
    const OpenFile file(path);
    const auto bytes = [&](std::uint64_t at, std::uint64_t count) {
        return file.read(static_cast<std::int64_t>(at), static_cast<std::int64_t>(count));
    };
    std::uint64_t position = 0, left = fs::file_size(path);
    bool has_index = false;
    while (left >= header) {
        const std::string box = bytes(position, header);
        std::uint64_t size = big_endian(box.substr(0, 4));
        if (size == 1 && left >= 2 * header) size = big_endian(bytes(position + header, header));
        if (size < header || size > left) return false;
        has_index = has_index || box.substr(4, 4) == "moov";
        position += size;
        left -= size;
    }
    return has_index && left == 0;
}

/// FFmpeg writes to stderr what it finds wrong with a file; the tools say it in one line. OpenCV
/// keeps this handler unless its environment variables ask for messages.
void silence_ffmpeg() {
    [[maybe_unused]] static const bool set = [] {
        av_log_set_callback([](void*, int, const char*, va_list) {});
        return true;
    }();
}

struct CloseInput {
    void operator()(AVFormatContext* file) const { avformat_close_input(&file); }
};
using InputFile = std::unique_ptr<AVFormatContext, CloseInput>;

/// A name that FFmpeg takes for that of a file even if it has a colon.
std::string file_name(const fs::path& path) {
    return fs::absolute(path).string();
}

/// Opens a film or sound of a kind that is in the file itself: playlists and lists would open other
/// files. Returns FFmpeg's code.
int open_film(const fs::path& path, AVFormatContext*& opened) {
    AVDictionary* options = nullptr;
    av_dict_set(&options, "format_whitelist",
                "mov,mp4,matroska,webm,avi,mpegts,mpeg,mpegvideo,flv,asf,ogg,mxf,gif,webp,apng,"
                "h264,hevc,av1,ivf,m4v,dv,nut,yuv4mpegpipe,mp3,wav,w64,aac,ac3,flac,aiff",
                0);
    av_dict_set(&options, "protocol_whitelist", "file", 0);
    const int code = avformat_open_input(&opened, file_name(path).c_str(), nullptr, &options);
    av_dict_free(&options);
    return code;
}

/// Shares of red and blue in the luma of a film's colour space; those of BT.601, which OpenCV
/// takes for every film, where it names none.
struct Luma {
    double red = 0.299, blue = 0.114;
};

Luma luma_of(AVColorSpace space) {
    switch (space) {
        case AVCOL_SPC_BT709: return {0.2126, 0.0722};
        case AVCOL_SPC_BT2020_NCL: return {0.2627, 0.0593};
        case AVCOL_SPC_SMPTE240M: return {0.212, 0.087};
        default: return {};
    }
}

/// RGB from luma and the differences of blue and red from it.
cv::Matx33d rgb_from_luma(const Luma& luma) {
    const double green = 1.0 - luma.red - luma.blue;
    const cv::Vec3d of_blue(0.0, -luma.blue / green, 1.0), of_red(1.0, -luma.red / green, 0.0);
    return {1.0, of_blue[0], of_red[0], 1.0, of_blue[1], of_red[1], 1.0, of_blue[2], of_red[2]};
}

/// OpenCV scales the differences as BT.601 does.
cv::Matx33d rgb_from_opencv_rgb(const Luma& luma) {
    const Luma opencv;
    const auto scale = cv::Matx33d::diag(
        {1.0, (1.0 - luma.blue) / (1.0 - opencv.blue), (1.0 - luma.red) / (1.0 - opencv.red)});
    return rgb_from_luma(luma) * scale * rgb_from_luma(opencv).inv();
}

/// What the file says of its pictures.
struct FilmFacts {
    std::int64_t frames = 0;        ///< 0 if the file does not count them
    std::int64_t about_frames = 0;  ///< by its length, else
    double frames_per_second = 0.0;
    std::optional<cv::Matx33d> recoloring{};  ///< of OpenCV's colours
};

/// Nothing for what is no film.
std::optional<FilmFacts> film_facts(const fs::path& path) {
    silence_ffmpeg();
    AVFormatContext* opened = nullptr;
    if (open_film(path, opened) < 0) return std::nullopt;
    const InputFile file(opened);
    if (avformat_find_stream_info(file.get(), nullptr) < 0) return std::nullopt;
    const int index = av_find_best_stream(file.get(), AVMEDIA_TYPE_VIDEO, -1, -1, nullptr, 0);
    if (index < 0) return std::nullopt;
    const AVStream& stream = *file->streams[index];
    FilmFacts facts{.frames = stream.nb_frames};
    if (stream.avg_frame_rate.num > 0 && stream.avg_frame_rate.den > 0)
        facts.frames_per_second = av_q2d(stream.avg_frame_rate);
    const double seconds = stream.duration > 0
                               ? static_cast<double>(stream.duration) * av_q2d(stream.time_base)
                               : static_cast<double>(file->duration) / AV_TIME_BASE;
    if (seconds > 0.0) facts.about_frames = std::llround(seconds * facts.frames_per_second);
    const Luma luma = luma_of(stream.codecpar->color_space);
    if (luma.red != Luma{}.red) facts.recoloring = rgb_from_opencv_rgb(luma);
    return facts;
}

Tensor tensor_of(const cv::Mat& bgr, int most_side, const std::optional<cv::Matx33d>& recoloring) {
    cv::Mat image = bgr;
    const double scale = static_cast<double>(most_side) / std::max(bgr.rows, bgr.cols);
    if (scale < 1.0) cv::resize(bgr, image, {}, scale, scale, cv::INTER_AREA);
    Tensor tensor({image.rows, image.cols, 3});
    cv::cvtColor(image, image, cv::COLOR_BGR2RGB);
    cv::Mat colors(image.rows, image.cols, CV_32FC3, tensor.mutable_values<float>().data());
    image.convertTo(colors, CV_32F, 1.0 / 255.0);
    if (!recoloring) return tensor;
    cv::transform(colors, colors, *recoloring);
    cv::min(cv::max(colors, 0.0), 1.0, colors);
    return tensor;
}

}  // namespace

struct FilmReader::State {
    fs::path path;
    int most_side;
    cv::VideoCapture film;
    FilmFacts facts;
    std::int64_t read = 0;

    bool grab() {
        if (film.grab()) {
            ++read;
            return true;
        }
        // Stated numbers are often off by a few frames.
        if (static_cast<double>(read) < 0.9 * static_cast<double>(facts.frames) - 2.0)
            fail<FileError>(path.string(), ": ends after ", read, " of ", facts.frames,
                            " frames, so it was cut off; copy it again, or write what is left of "
                            "it to a new file");
        return false;
    }
};

FilmReader::FilmReader(const fs::path& path, int most_side)
    : state_(std::make_unique<State>(State{path, most_side, {}, {}})) {
    std::error_code error;
    if (fs::is_directory(path, error)) fail<FileError>(path.string(), ": is a folder, not a film");
    if (!fs::is_regular_file(path, error))
        fail<FileError>(path.string(), ": ",
                        error && error != std::errc::no_such_file_or_directory ? error.message()
                                                                               : "no such file");
    silence_ffmpeg();
    const std::optional<FilmFacts> facts = film_facts(path);
    if (!facts || !state_->film.open(file_name(path), cv::CAP_FFMPEG) ||
        state_->film.get(cv::CAP_PROP_FRAME_WIDTH) <= 0.0)
        fail<FileError>(path.string(), ": no film that can be read, or one that was cut off");
    state_->facts = *facts;
}
FilmReader::~FilmReader() = default;
FilmReader::FilmReader(FilmReader&&) noexcept = default;

double FilmReader::frames_per_second() const {
    const double stated = state_->facts.frames_per_second;
    const double rate = stated > 0.0 ? stated : state_->film.get(cv::CAP_PROP_FPS);
    constexpr double usual = 25.0;
    return std::isfinite(rate) && rate > 0.0 ? rate : usual;
}

std::int64_t FilmReader::stated_frames() const {
    const FilmFacts& facts = state_->facts;
    return facts.frames > 0 ? facts.frames : facts.about_frames;
}

std::optional<Tensor> FilmReader::next() {
    cv::Mat frame;
    if (!state_->grab()) return std::nullopt;
    if (!state_->film.retrieve(frame) || frame.type() != CV_8UC3)
        fail<FileError>(state_->path.string(), ": frame ", state_->read, " cannot be decoded");
    return tensor_of(frame, state_->most_side, state_->facts.recoloring);
}

bool FilmReader::skip() {
    return state_->grab();
}

struct FilmWriter::State {
    fs::path path, file;
    int height, width;
    cv::Size size;  // H.264 halves the resolution of colour, so images must have even sides.
    cv::VideoWriter writer;
};

FilmWriter::FilmWriter(const fs::path& path, const fs::path& file, std::int64_t height,
                       std::int64_t width, double frames_per_second)
    : state_(std::make_unique<State>(
          State{path, file, static_cast<int>(height), static_cast<int>(width), {}, {}})) {
    if (const std::ofstream probe(file, std::ios::binary); !probe)
        fail<FileError>(path.string(), ": cannot be written (", std::strerror(errno), ")");
    silence_ffmpeg();
    state_->size = {state_->width + state_->width % 2, state_->height + state_->height % 2};
    state_->writer.open(file_name(file), cv::CAP_FFMPEG,
                        cv::VideoWriter::fourcc('a', 'v', 'c', '1'), frames_per_second,
                        state_->size);
    if (!state_->writer.isOpened())
        fail<FileError>(path.string(),
                        ": cannot be written (no H.264 encoder for this size and rate)");
}
FilmWriter::~FilmWriter() = default;

void FilmWriter::add(const Tensor& frame) {
    if (!(frame.shape() == Shape{state_->height, state_->width, 3}))
        fail<ShapeError>("[film] a frame of ", frame.shape(), " in a film of ", state_->height,
                         " x ", state_->width, " pixels");
    std::vector<std::uint8_t> bytes = image_bytes(frame);
    cv::Mat image;
    cv::cvtColor(cv::Mat(state_->height, state_->width, CV_8UC3, bytes.data()), image,
                 cv::COLOR_RGB2BGR);
    cv::copyMakeBorder(image, image, 0, state_->size.height - state_->height, 0,
                       state_->size.width - state_->width, cv::BORDER_REPLICATE);
    state_->writer.write(image);
}

void FilmWriter::finish() {
    state_->writer.release();
    if (!is_whole_mp4(state_->file))
        fail<FileError>(state_->path.string(),
                        ": cannot be written (the film is not whole; is the disk full?)");
}

namespace {

/// Throws for a negative code of FFmpeg.
int checked(int code, const fs::path& path) {
    if (code >= 0) return code;
    std::array<char, AV_ERROR_MAX_STRING_SIZE> text{};
    fail<FileError>(path.string(), ": its sound cannot be copied (",
                    av_make_error_string(text.data(), text.size(), code), ')');
}

struct CloseOutput {
    void operator()(AVFormatContext* file) const {
        avio_closep(&file->pb);
        avformat_free_context(file);
    }
};
struct FreePacket {
    void operator()(AVPacket* packet) const { av_packet_free(&packet); }
};

/// One stream of a file, packet by packet.
class Track {
public:
    Track(const fs::path& path, AVMediaType type) : path_(path), packet_(av_packet_alloc()) {
        AVFormatContext* file = nullptr;
        checked(open_film(path, file), path);
        file_.reset(file);
        checked(avformat_find_stream_info(file, nullptr), path);
        index_ = av_find_best_stream(file, type, -1, -1, nullptr, 0);
        const int pictures = av_find_best_stream(file, AVMEDIA_TYPE_VIDEO, -1, -1, nullptr, 0);
        if (index_ < 0 || pictures < 0) return;
        const AVStream* first = file->streams[pictures];
        if (first->start_time != AV_NOPTS_VALUE)
            start_ = av_rescale_q(first->start_time, first->time_base, stream().time_base);
    }
    [[nodiscard]] bool exists() const { return index_ >= 0; }
    [[nodiscard]] const AVStream& stream() const { return *file_->streams[index_]; }
    [[nodiscard]] AVPacket* packet() const { return packet_.get(); }

    /// Reads the next packet, with times that count from the file's first picture; false at the
    /// end.
    bool next() {
        do {
            av_packet_unref(packet());
            const int code = av_read_frame(file_.get(), packet());
            if (code == AVERROR_EOF) return false;
            checked(code, path_);
        } while (packet()->stream_index != index_);
        if (packet()->dts != AV_NOPTS_VALUE) packet()->dts -= start_;
        if (packet()->pts != AV_NOPTS_VALUE) packet()->pts -= start_;
        return true;
    }

private:
    fs::path path_;
    InputFile file_;
    std::unique_ptr<AVPacket, FreePacket> packet_;
    int index_ = -1;
    std::int64_t start_ = 0;
};

void write_both(std::array<Track, 2>& tracks, const fs::path& path) {
    AVFormatContext* file = nullptr;
    const std::string name = file_name(path);
    checked(avformat_alloc_output_context2(&file, nullptr, "mp4", name.c_str()), path);
    const std::unique_ptr<AVFormatContext, CloseOutput> owner(file);
    std::array<bool, 2> more{};
    for (std::size_t i = 0; i < tracks.size(); ++i) {
        AVStream* copy = avformat_new_stream(file, nullptr);
        checked(avcodec_parameters_copy(copy->codecpar, tracks[i].stream().codecpar), path);
        copy->codecpar->codec_tag = 0;
        copy->time_base = tracks[i].stream().time_base;
        more[i] = tracks[i].next();
    }
    checked(avio_open(&file->pb, name.c_str(), AVIO_FLAG_WRITE), path);
    checked(avformat_write_header(file, nullptr), path);
    // The packet that is due first, so that little waits in memory.
    while (more[0] || more[1]) {
        const bool later = av_compare_ts(tracks[0].packet()->dts, tracks[0].stream().time_base,
                                         tracks[1].packet()->dts, tracks[1].stream().time_base) > 0;
        const std::size_t i = !more[0] || (more[1] && later) ? 1 : 0;
        AVPacket* packet = tracks[i].packet();
        packet->stream_index = static_cast<int>(i);
        packet->pos = -1;
        av_packet_rescale_ts(packet, tracks[i].stream().time_base, file->streams[i]->time_base);
        checked(av_interleaved_write_frame(file, packet), path);
        more[i] = tracks[i].next();
    }
    checked(av_write_trailer(file), path);
    checked(avio_closep(&file->pb), path);
}

}  // namespace

FilmSound add_sound(const fs::path& from, const fs::path& to) {
    silence_ffmpeg();
    std::array<Track, 2> tracks{Track(to, AVMEDIA_TYPE_VIDEO), Track(from, AVMEDIA_TYPE_AUDIO)};
    if (!tracks[0].exists()) fail<FileError>(to.string(), ": has no pictures");
    if (!tracks[1].exists()) return FilmSound::none;
    const AVOutputFormat* mp4 = av_guess_format("mp4", nullptr, nullptr);
    if (avformat_query_codec(mp4, tracks[1].stream().codecpar->codec_id, FF_COMPLIANCE_NORMAL) != 1)
        return FilmSound::other;
    write_whole(
        to, [&](const fs::path& temporary) { write_both(tracks, temporary); }, Durability::none);
    return FilmSound::kept;
}

}  // namespace stymo
