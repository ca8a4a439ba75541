#pragma once

#include <filesystem>

namespace stymo {

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
