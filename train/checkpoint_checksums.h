#pragma once

#include <filesystem>

namespace stymo {

/// Writes `folder`/checksums.txt: CRC-32C in hexadecimal, size and name of every other file in the
/// folder.
void write_checksums(const std::filesystem::path& folder);
/// Throws FileError, which names the first file whose size or checksum differs from checksums.txt,
/// or that is missing in the folder or in checksums.txt. Accepts a folder of an older version,
/// which has no checksums.txt.
void verify_checksums(const std::filesystem::path& folder);

}  // namespace stymo
