#include "core/io/event_file.h"

#include <bit>
#include <chrono>
#include <fstream>
#include <string>
#include <utility>

#include "core/error.h"
#include "core/io/checksum.h"
#include "core/io/image.h"
#include "core/io/protobuf.h"

namespace stymo {
namespace {

namespace fs = std::filesystem;

template <class Unsigned>
std::string little_endian(Unsigned value) {
    std::string bytes;
    for (std::size_t i = 0; i < sizeof value; ++i)
        bytes += static_cast<char>((value >> (8 * i)) & 0xFFU);
    return bytes;
}

using protobuf::bytes_field;
using protobuf::integer_field;
using protobuf::key;
using protobuf::Wire;

std::string double_field(std::uint32_t field, double value) {
    return key(field, Wire::fixed64) + little_endian(std::bit_cast<std::uint64_t>(value));
}
std::string float_field(std::uint32_t field, float value) {
    return key(field, Wire::fixed32) + little_endian(std::bit_cast<std::uint32_t>(value));
}
/// Field `what` of an Event is one of file_version, summary and session_log.
std::string event(double seconds, std::int64_t step, const std::string& what) {
    // Protocol buffers omit fields with their default value.
    return double_field(1, seconds) + (step == 0 ? "" : integer_field(2, step)) + what;
}
std::string file_version_field() {
    return bytes_field(3, "brain.Event:2");
}
std::string summary_field(std::string_view tag, const std::string& value) {
    return bytes_field(5, bytes_field(1, bytes_field(1, tag) + value));
}
std::string session_start_field() {
    constexpr std::int64_t start = 1;
    return bytes_field(7, integer_field(1, start));
}

/// The format masks checksums, so that checksums of data that itself holds checksums stay reliable.
std::uint32_t masked_checksum(std::string_view bytes) {
    return std::rotr(crc32c(bytes), 15) + 0xA282EAD8U;
}

std::string record(const std::string& message) {
    const std::string length = little_endian(std::uint64_t{message.size()});
    return length + little_endian(masked_checksum(length)) + message +
           little_endian(masked_checksum(message));
}

double system_seconds() {
    return std::chrono::duration<double>(std::chrono::system_clock::now().time_since_epoch())
        .count();
}

fs::path new_file(const fs::path& folder, double seconds) {
    // TensorBoard reads the files of a folder in the order of their names.
    for (auto second = static_cast<std::int64_t>(seconds);; ++second) {
        fs::path path = folder / ("events.out.tfevents." + std::to_string(second) + ".stymo");
        if (!fs::exists(path)) return path;
    }
}

}  // namespace

struct EventFile::Implementation {
    Clock clock;
    fs::path path;
    std::ofstream stream;

    Implementation(const fs::path& folder, Clock event_clock)
        : clock(std::move(event_clock)),
          path(new_file(folder, clock())),
          stream(path, std::ios::binary) {}

    void append(std::int64_t step, const std::string& what) {
        const std::string bytes = record(event(clock(), step, what));
        stream.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
        if (!stream.flush())
            fail<FileError>(path.string(), ": cannot be written; check space and rights");
    }
};

EventFile::EventFile(const fs::path& folder, Clock clock)
    : implementation_(std::make_unique<Implementation>(
          folder, clock ? std::move(clock) : Clock(system_seconds))) {
    implementation_->append(0, file_version_field());
}
EventFile::~EventFile() = default;
EventFile::EventFile(EventFile&&) noexcept = default;
EventFile& EventFile::operator=(EventFile&&) noexcept = default;

void EventFile::scalar(std::int64_t step, std::string_view tag, double value) {
    implementation_->append(step, summary_field(tag, float_field(2, static_cast<float>(value))));
}

void EventFile::image(std::int64_t step, std::string_view tag, const Tensor& image) {
    const std::string png = png_bytes(image);
    const std::string value = integer_field(1, image.shape(0)) + integer_field(2, image.shape(1)) +
                              integer_field(3, image.shape(2)) + bytes_field(4, png);
    implementation_->append(step, summary_field(tag, bytes_field(4, value)));
}

void EventFile::restart(std::int64_t step) {
    implementation_->append(step, session_start_field());
}

}  // namespace stymo
