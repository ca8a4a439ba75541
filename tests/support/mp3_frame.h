#pragma once

#include <string>

namespace stymo {

/// A silent frame of an MP3 file (MPEG-1 layer III, 128 kbit/s, 44,100 Hz, mono: 417 bytes, 1,152
/// samples) that holds its number where decoders do not look.
inline std::string mp3_frame(int number) {
    std::string frame = "\xff\xfb\x90\xc0" + std::string(413, '\0');
    return frame.replace(400, 5, "no " + std::to_string(10 + number));
}

/// So many frames, one after the other.
inline std::string mp3_frames(int count) {
    std::string file;
    for (int i = 0; i < count; ++i) file += mp3_frame(i);
    return file;
}

}  // namespace stymo
