#include "apps/bench/peer.h"

#include <algorithm>
#include <regex>
#include <utility>
#include <vector>

#include "apps/common/child_process.h"
#include "core/error.h"

namespace stymo {

namespace {

/// The BLAS of Debian's PyTorch chooses slow kernels on newer processors by itself.
const std::vector<std::string> peer_environment{"OPENBLAS_CORETYPE=SkylakeX"};

/// Milliseconds in the line "render: 1100.0 ms (...)".
std::optional<double> milliseconds_in(const std::string& text, const std::string& what) {
    std::smatch found;
    if (!std::regex_search(text, found, std::regex(what + R"(: ([0-9.]+) ms)"))) return {};
    return std::stod(found[1]);
}

std::string last_line(std::string text) {
    text.erase(text.find_last_not_of('\n') + 1);
    return text.substr(text.find_last_of('\n') + 1);
}

}  // namespace

Peer::Peer(PeerProgram program, DecoderConfig decoder, std::int64_t samples)
    : program_(std::move(program)), decoder_(std::move(decoder)), samples_(samples) {
    if (program_.script.empty()) {
        missing_ = "no --peer is named";
    } else if (!std::filesystem::is_regular_file(program_.script)) {
        fail<FileError>(program_.script.string(),
                        ": no such file; --peer names scripts/torch_peer.py of the project");
    } else if (run_child({program_.python.string(), "-c", "import torch, torchvision"}).exit_code !=
               0) {
        missing_ = program_.python.string() +
                   " has no PyTorch (Debian: python3-torch python3-torchvision libopenblas0)";
    }
}

std::optional<PeerTime> Peer::measure(const std::string& what, int threads, int repeats) const {
    if (!missing_.empty() || what.empty()) return std::nullopt;
    constexpr std::int64_t discriminator_side = 256;
    const bool discriminator = what == "disc" || what == "r1";
    const std::int64_t side =
        discriminator ? std::min(discriminator_side, decoder_.resolution) : decoder_.resolution;
    const ChildOutcome outcome =
        run_child({program_.python.string(), program_.script.string(), "--threads",
                   std::to_string(threads), "--width", std::to_string(decoder_.field_width),
                   "--layers", std::to_string(decoder_.field_layers), "--samples",
                   std::to_string(samples_), "--res", std::to_string(side), "--batch",
                   discriminator ? "4" : "1", "-n", std::to_string(repeats), what},
                  peer_environment);
    const std::optional<double> milliseconds = milliseconds_in(outcome.out, what);
    if (outcome.exit_code != 0 || !milliseconds)
        fail<Error>(program_.script.string(), ": ", what,
                    " was not measured: ", last_line(outcome.err), "; leave out --peer");
    return PeerTime{*milliseconds / 1e3, outcome.peak_memory};
}

}  // namespace stymo
