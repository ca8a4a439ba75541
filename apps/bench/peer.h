#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "nn/models/decoder.h"

namespace stymo {

struct PeerTime {
    double seconds = 0.0;  ///< median
    double peak_memory = 0.0;
};

/// The same work in PyTorch, by scripts/torch_peer.py and the system's Python.
class Peer {
public:
    /// `script` empty, or PyTorch not installed: there is no peer, and `missing` says why.
    /// `decoder` is what it is to imitate.
    Peer(std::filesystem::path script, DecoderConfig decoder, std::int64_t samples);

    [[nodiscard]] const std::string& missing() const { return missing_; }
    /// Runs one of the script's measurements; nothing without a peer. Throws Error if the script
    /// fails.
    [[nodiscard]] std::optional<PeerTime> measure(const std::string& what, int threads,
                                                  int repeats) const;

private:
    std::filesystem::path script_;
    DecoderConfig decoder_;
    std::int64_t samples_;
    std::string missing_;
};

}  // namespace stymo
