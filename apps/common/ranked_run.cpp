#include "apps/common/ranked_run.h"

#include <unistd.h>

#include <algorithm>
#include <exception>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <iterator>

#include "apps/common/mpi_ranks.h"
#include "apps/common/process_setup.h"
#include "core/error.h"
#include "core/io/checksum.h"
#include "core/io/file.h"
#include "core/matmul_precision.h"

namespace stymo {

namespace {

/// From here on this process prints nothing.
void be_silent() {
    // Never destroyed, because the streams are flushed after every destructor of this file.
    static std::ofstream& nowhere = *new std::ofstream("/dev/null");
    std::cout.rdbuf(nowhere.rdbuf());
    std::cerr.rdbuf(nowhere.rdbuf());
}

std::string checksum(const std::string& bytes) {
    return std::to_string(crc32c(bytes)) + " " + std::to_string(bytes.size());
}

/// What `part` threw, or nothing.
std::string problem_of(const std::function<void()>& part) {
    try {
        if (part) part();
        return "";
    } catch (const std::exception& error) {
        return error.what();
    }
}

/// Throws the first problem on every rank.
void require_none(Ranks& ranks, const std::string& problem) {
    const std::string host = problem.empty() ? "" : host_name() + ": " + problem;
    const std::vector<std::string> all = gather(ranks, host);
    const auto found =
        std::ranges::find_if(all, [](const std::string& text) { return !text.empty(); });
    if (found == all.end()) return;
    if (std::ranges::all_of(all, [](const std::string& text) { return !text.empty(); }))
        fail<ValueError>(found->substr(found->find(": ") + 2));
    fail<ValueError>("rank ", found - all.begin(), " on ", *found);
}

}  // namespace

CommonState common_state(const TrainConfig& config, const Dataset& training,
                         const TrainingState& state, const std::filesystem::path& initial_model) {
    std::string photos;
    for (std::int64_t i = 0; i < training.size(); ++i) {
        const std::filesystem::path& image = training.files(i).image;
        photos += image.filename().string() + ' ' +
                  std::to_string(std::filesystem::file_size(image)) + '\n';
    }
    return {{"a configuration", checksum(to_json(config))},
            {"a seed", std::to_string(state.seed)},
            {"a folder of photos", checksum(photos)},
            {"a checkpoint", std::to_string(state.step)},
            {"an initial model", initial_model.empty() ? "" : checksum(read_file(initial_model))}};
}

AppResult run_as_rank(Ranks& ranks, const std::string& program, const RankedRun& run) {
    if (!ranks.leads()) be_silent();
    require_none(ranks, ranks.leads() ? problem_of(run.claim) : "");
    require_none(ranks, problem_of(run.prepare));
    CommonState state{
        {"a precision of matrix products", name_of(computed_precision(matmul_precision()))},
        {"a program", checksum(read_file("/proc/self/exe"))}};
    require_none(ranks,
                 problem_of([&] { std::ranges::copy(run.state(), std::back_inserter(state)); }));
    for (const auto& [what, value] : state) require_equal(ranks, what, value);
    try {
        if (ranks.leads()) return run.lead();
        run.follow();
        return {};
    } catch (const std::exception& error) {
        const std::string line = program + ": rank " + std::to_string(ranks.rank()) + " on " +
                                 host_name() + ": " + error.what() + '\n';
        static_cast<void>(::write(STDERR_FILENO, line.data(), line.size()) == 0);
        end_all_ranks();
    }
}

AppResult run_on_ranks(const std::string& program,
                       const std::function<RankedRun(Ranks& ranks)>& parts) {
    if (const std::unique_ptr<Ranks> ranks = started_ranks())
        return run_as_rank(*ranks, program, parts(*ranks));
    OneRank alone;
    const RankedRun run = parts(alone);
    if (run.claim) run.claim();
    run.prepare();
    return run.lead();
}

}  // namespace stymo
