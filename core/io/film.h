#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>

#include "core/tensor.h"

namespace stymo {

/// Reads the frames of a film one after the other; memory does not grow with its length.
class FilmReader {
public:
    /// Frames whose longer side exceeds `most_side` pixels are reduced to it. Throws FileError for
    /// a file that is missing or no film.
    explicit FilmReader(const std::filesystem::path& path, int most_side = 1280);
    ~FilmReader();
    FilmReader(FilmReader&&) noexcept;

    [[nodiscard]] double frames_per_second() const;
    /// As the file says, or by its length, which may be wrong; 0 if it says neither.
    [[nodiscard]] std::int64_t stated_frames() const;
    /// The next frame (height, width, 3) in [0, 1], upright, with the colour space that the file
    /// names (BT.601 where it names none); nothing at the end. Throws FileError if it cannot be
    /// decoded, or the film was cut off: it ends long before the number of frames in the file.
    [[nodiscard]] std::optional<Tensor> next();
    /// Passes over the next frame without converting it; false at the end. Throws like `next`.
    [[nodiscard]] bool skip();

private:
    struct State;
    std::unique_ptr<State> state_;
};

/// Writes an MP4 file (H.264) frame by frame.
class FilmWriter {
public:
    /// Writes to `file`; messages name `path`. Throws FileError if there is no encoder.
    FilmWriter(const std::filesystem::path& path, const std::filesystem::path& file,
               std::int64_t height, std::int64_t width, double frames_per_second);
    ~FilmWriter();
    FilmWriter(const FilmWriter&) = delete;
    FilmWriter& operator=(const FilmWriter&) = delete;

    /// A frame (height, width, 3) in [0, 1]. Throws ShapeError for another size.
    void add(const Tensor& frame);
    /// Ends the file. Throws FileError if it is not whole.
    void finish();

private:
    struct State;
    std::unique_ptr<State> state_;
};

/// What became of the sound of a film.
enum class FilmSound {
    none,  ///< the film has none
    kept,
    other,  ///< it is encoded in a way that MP4 files do not have
};

/// Puts the first sound of the film `from`, as it is encoded there, under the MP4 file `to`, whose
/// first picture belongs to the first one of `from`. Where there is no sound to keep, `to` stays as
/// it is. Throws FileError if one of them cannot be read or written; then, too, `to` stays.
FilmSound add_sound(const std::filesystem::path& from, const std::filesystem::path& to);

}  // namespace stymo
