#include "core/io/film_sound.h"

extern "C" {
#include <libavcodec/avcodec.h>
#include <libavformat/avformat.h>
}

#include <array>
#include <memory>

#include "core/error.h"
#include "core/io/file.h"

namespace stymo {

namespace {

namespace fs = std::filesystem;

/// Throws for a negative code of FFmpeg.
int checked(int code, const fs::path& path) {
    if (code >= 0) return code;
    std::array<char, AV_ERROR_MAX_STRING_SIZE> text{};
    fail<FileError>(path.string(), ": its sound cannot be copied (",
                    av_make_error_string(text.data(), text.size(), code), ')');
}

struct CloseInput {
    void operator()(AVFormatContext* file) const { avformat_close_input(&file); }
};
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
        checked(avformat_open_input(&file, path.c_str(), nullptr, nullptr), path);
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
    std::unique_ptr<AVFormatContext, CloseInput> file_;
    std::unique_ptr<AVPacket, FreePacket> packet_;
    int index_ = -1;
    std::int64_t start_ = 0;
};

void write_both(std::array<Track, 2>& tracks, const fs::path& path) {
    AVFormatContext* file = nullptr;
    checked(avformat_alloc_output_context2(&file, nullptr, "mp4", path.c_str()), path);
    const std::unique_ptr<AVFormatContext, CloseOutput> owner(file);
    std::array<bool, 2> more{};
    for (std::size_t i = 0; i < tracks.size(); ++i) {
        AVStream* copy = avformat_new_stream(file, nullptr);
        checked(avcodec_parameters_copy(copy->codecpar, tracks[i].stream().codecpar), path);
        copy->codecpar->codec_tag = 0;
        copy->time_base = tracks[i].stream().time_base;
        more[i] = tracks[i].next();
    }
    checked(avio_open(&file->pb, path.c_str(), AVIO_FLAG_WRITE), path);
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
    av_log_set_level(AV_LOG_QUIET);
    std::array<Track, 2> tracks{Track(to, AVMEDIA_TYPE_VIDEO), Track(from, AVMEDIA_TYPE_AUDIO)};
    if (!tracks[1].exists()) return FilmSound::none;
    const AVOutputFormat* mp4 = av_guess_format("mp4", nullptr, nullptr);
    if (avformat_query_codec(mp4, tracks[1].stream().codecpar->codec_id, FF_COMPLIANCE_NORMAL) != 1)
        return FilmSound::other;
    write_whole(
        to, [&](const fs::path& temporary) { write_both(tracks, temporary); }, Durability::none);
    return FilmSound::kept;
}

}  // namespace stymo
