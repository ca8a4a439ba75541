#include "apps/common/ranked_run.h"

#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <exception>
#include <fstream>
#include <iostream>
#include <iterator>
#include <thread>

#include "apps/common/process_setup.h"
#include "core/clock.h"
#include "core/error.h"
#include "core/io/checksum.h"
#include "core/io/file.h"
#include "core/matmul_precision.h"
#include "render/pose_json.h"

#ifdef STYMO_WITH_MPI
#define OMPI_SKIP_MPICXX 1
#include <mpi.h>
#endif

namespace stymo {

namespace {

/// What mpirun and Slurm set in the environment of the processes that they start.
bool started_as_rank() {
    for (const char* name : {"OMPI_COMM_WORLD_SIZE", "PMIX_RANK", "PMI_RANK"})
        if (std::getenv(name) != nullptr) return true;
    return false;
}

#ifdef STYMO_WITH_MPI

class MpiRanks final : public Ranks {
public:
    MpiRanks() {
        int provided = 0;
        MPI_Init_thread(nullptr, nullptr, MPI_THREAD_SERIALIZED, &provided);
        if (provided < MPI_THREAD_SERIALIZED)
            fail<ValueError>(
                "this Open MPI was built without support for threads, which ranks need");
        MPI_Comm_rank(MPI_COMM_WORLD, &rank_);
        MPI_Comm_size(MPI_COMM_WORLD, &size_);
    }
    ~MpiRanks() override { MPI_Finalize(); }
    MpiRanks(const MpiRanks&) = delete;
    MpiRanks& operator=(const MpiRanks&) = delete;

    [[nodiscard]] int rank() const override { return rank_; }
    [[nodiscard]] int size() const override { return size_; }

    // An error of a transfer ends all ranks, as is MPI's default.
    void send(std::span<const std::byte> bytes, int to) override {
        const double begin = seconds_now();
        for_each_piece(bytes,
                       [to](std::span<const std::byte> piece) { wait_for(sending(piece, to)); });
        exchange_seconds_ += seconds_now() - begin;
    }
    void receive(std::span<std::byte> bytes, int from) override {
        const double begin = seconds_now();
        for_each_piece(bytes,
                       [from](std::span<std::byte> piece) { wait_for(receiving(piece, from)); });
        exchange_seconds_ += seconds_now() - begin;
    }
    void exchange(std::span<const std::byte> sent, std::span<std::byte> received,
                  int other) override {
        const double begin = seconds_now();
        // As many pieces as the longer message needs; the last pieces of the shorter one are empty.
        for (std::size_t at = 0; at < std::max(sent.size(), received.size()); at += most_bytes) {
            const MPI_Request in = receiving(piece_of(received, at), other);
            wait_for(sending(piece_of(sent, at), other));
            wait_for(in);
        }
        exchange_seconds_ += seconds_now() - begin;
    }
    [[nodiscard]] double exchange_seconds() const override { return exchange_seconds_; }

private:
    /// MPI counts bytes in an int.
    static constexpr std::size_t most_bytes = 1 << 30;

    static MPI_Request sending(std::span<const std::byte> piece, int to) {
        MPI_Request request = MPI_REQUEST_NULL;
        MPI_Isend(piece.data(), static_cast<int>(piece.size()), MPI_BYTE, to, 0, MPI_COMM_WORLD,
                  &request);
        return request;
    }
    static MPI_Request receiving(std::span<std::byte> piece, int from) {
        MPI_Request request = MPI_REQUEST_NULL;
        MPI_Irecv(piece.data(), static_cast<int>(piece.size()), MPI_BYTE, from, 0, MPI_COMM_WORLD,
                  &request);
        return request;
    }
    /// Polls and sleeps, because Open MPI's own waiting would occupy a processor that computing
    /// threads need.
    static void wait_for(MPI_Request request) {
        int done = 0;
        while (MPI_Test(&request, &done, MPI_STATUS_IGNORE) == MPI_SUCCESS && done == 0)
            std::this_thread::sleep_for(std::chrono::microseconds(100));
    }

    template <class Byte>
    static std::span<Byte> piece_of(std::span<Byte> bytes, std::size_t begin) {
        const std::size_t from = std::min(begin, bytes.size());
        return bytes.subspan(from, std::min(most_bytes, bytes.size() - from));
    }
    template <class Byte, class Body>
    static void for_each_piece(std::span<Byte> bytes, const Body& body) {
        for (std::size_t begin = 0; begin < bytes.size(); begin += most_bytes)
            body(piece_of(bytes, begin));
    }

    int rank_ = 0;
    int size_ = 1;
    double exchange_seconds_ = 0.0;
};

#endif

/// After an error on this rank.
[[noreturn]] void end_all_ranks() {
#ifdef STYMO_WITH_MPI
    MPI_Abort(MPI_COMM_WORLD, 1);
#endif
    std::_Exit(1);
}

}  // namespace

std::unique_ptr<Ranks> started_ranks() {
    if (!started_as_rank()) return nullptr;
#ifdef STYMO_WITH_MPI
    return std::make_unique<MpiRanks>();
#else
    fail<ValueError>(
        "built without Open MPI, so it cannot be one of several ranks; install libopenmpi-dev and "
        "build again, or start it without mpirun");
#endif
}

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
        const FaceFiles& files = training.files(i);
        photos += files.image.filename().string();
        for (const std::filesystem::path& file : {files.image, files.mask, files.unknown})
            photos += ' ' + (file.empty() ? "" : std::to_string(std::filesystem::file_size(file)));
        if (const FaceEntry* entry = training.entry(i); entry != nullptr) {
            photos += ' ' + std::to_string(entry->size);
            if (entry->pose) photos += ' ' + to_json(*entry->pose).text();
        }
        photos += '\n';
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
