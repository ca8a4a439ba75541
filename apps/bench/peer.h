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

/// What runs the same work in PyTorch.
struct PeerProgram {
    std::filesystem::path script;                       ///< scripts/torch_peer.py; empty: none
    std::filesystem::path python = "/usr/bin/python3";  ///< Debian's PyTorch is made for this one
};

/// The same work in PyTorch.
class Peer {
public:
    /// No script, or no PyTorch in that Python: there is no peer, and `missing` says why. `decoder`
    /// is what it is to imitate. Throws FileError for a script that does not exist.
    Peer(PeerProgram program, DecoderConfig decoder, std::int64_t samples);

    [[nodiscard]] const std::string& missing() const { return missing_; }
    /// Runs one of the script's measurements; nothing without a peer. Throws Error if the script
    /// fails.
    [[nodiscard]] std::optional<PeerTime> measure(const std::string& what, int threads,
                                                  int repeats) const;

private:
    PeerProgram program_;
    DecoderConfig decoder_;
    std::int64_t samples_;
    std::string missing_;
};

}  // namespace stymo
