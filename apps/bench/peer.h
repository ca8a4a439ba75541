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

/// The program that does the same work in PyTorch.
struct PeerProgram {
    std::filesystem::path script;  ///< scripts/torch_peer.py; empty: none
    /// Python for which Debian's PyTorch is built.
    std::filesystem::path python = "/usr/bin/python3";
};

/// The same work in PyTorch.
class Peer {
public:
    /// Without a script, or without PyTorch in that Python, there is no peer, and `missing` says
    /// why. `decoder` is the configuration that the peer reproduces. Throws FileError for a script
    /// that does not exist.
    Peer(PeerProgram program, DecoderConfig decoder, std::int64_t samples);

    [[nodiscard]] const std::string& missing() const { return missing_; }
    /// Runs one of the script's measurements; returns nothing without a peer. Throws Error if the
    /// script fails.
    [[nodiscard]] std::optional<PeerTime> measure(const std::string& what, int threads,
                                                  int repeats) const;

private:
    PeerProgram program_;
    DecoderConfig decoder_;
    std::int64_t samples_;
    std::string missing_;
};

}  // namespace stymo
