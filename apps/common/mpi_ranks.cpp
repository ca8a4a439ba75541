#include "apps/common/mpi_ranks.h"

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <thread>

#include "core/clock.h"
#include "core/error.h"

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

void end_all_ranks() {
#ifdef STYMO_WITH_MPI
    MPI_Abort(MPI_COMM_WORLD, 1);
#endif
    std::_Exit(1);
}

bool has_mpi() {
#ifdef STYMO_WITH_MPI
    return true;
#else
    return false;
#endif
}

}  // namespace stymo
