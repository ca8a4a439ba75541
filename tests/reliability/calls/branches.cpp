#include "reliability/calls/branches.h"

#include <fcntl.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <catch2/catch.hpp>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <new>
#include <stdexcept>

#include "core/io/file.h"

namespace stymo {

namespace fs = std::filesystem;

namespace {

// A tool asks the test what to do before a call, and gets an order. After a copy has ended it asks
// again. Nothing on the tool's side allocates.

struct Question {
    long number;  ///< of the call
    int status;   ///< of the copy that ended, or -1 before the first
};

struct Order {
    bool copy;  ///< false: go on
    bool ever;
    char folder[PATH_MAX];  ///< where the copy works
};

void must(bool done) {
    if (!done) ::_exit(126);
}

/// A copy of a process has only the thread that made it. Threads of libraries are left alone.
bool is_first_thread() {
    return ::gettid() == ::getpid();
}

class CountingVisitor : public CallVisitor {
public:
    explicit CountingVisitor(CallPlaces& places) : places_(places) {}
    [[nodiscard]] bool fails(long /*number*/) override {
        if (is_first_thread()) ++places_.at(current_call_stack().hash()).calls;
        return false;
    }

private:
    CallPlaces& places_;
};

/// Moves this process to another folder with the same files: open files too. Those elsewhere are
/// opened again, because a position in a file is common to a process and its copy.
void move_to(const char* from, const char* to) {
    must(::chdir(to) == 0);
    const std::size_t length = std::strlen(from);
    for (int number = 3; number < 64; ++number) {
        char link[64];
        char path[2 * PATH_MAX];
        std::snprintf(link, sizeof link, "/proc/self/fd/%d", number);
        const ssize_t size = ::readlink(link, path, PATH_MAX);
        if (size <= 0) continue;
        path[size] = '\0';
        struct stat status {};
        if (::fstat(number, &status) != 0 || !S_ISREG(status.st_mode) || status.st_nlink == 0)
            continue;
        const int flags = ::fcntl(number, F_GETFL) & ~(O_CREAT | O_TRUNC | O_EXCL);
        const off_t offset = ::lseek(number, 0, SEEK_CUR);
        char other[2 * PATH_MAX];
        const bool moves = std::strncmp(path, from, length) == 0;
        std::snprintf(other, sizeof other, "%s%.4000s", moves ? to : "",
                      moves ? path + length : path);
        const int opened = ::open(other, flags | O_CLOEXEC);
        must(opened >= 0 && ::lseek(opened, offset, SEEK_SET) == offset);
        must(::dup3(opened, number, O_CLOEXEC) == number && ::close(opened) == 0);
    }
}

void redirect(const char* file, int stream) {
    const int opened = ::open(file, O_WRONLY | O_CREAT | O_TRUNC, 0644);
    must(opened >= 0 && ::dup2(opened, stream) == stream && ::close(opened) == 0);
}

class BranchingVisitor : public CallVisitor {
public:
    BranchingVisitor(CallPlaces& places, Chosen chosen, int socket, std::string folder)
        : places_(places), chosen_(chosen), socket_(socket), folder_(std::move(folder)) {}

    [[nodiscard]] bool fails(long number) override {
        if (is_copy_) return ever_;
        if (!is_first_thread()) return false;
        CallPlace& place = places_.at(current_call_stack().hash());
        ++place.seen;
        if (chosen_ == Chosen::ends && place.seen != 1 && place.seen != place.calls) return false;
        Question question{number, -1};
        while (true) {
            Order order{};
            must(::write(socket_, &question, sizeof question) == sizeof question);
            must(::read(socket_, &order, sizeof order) == sizeof order);
            if (!order.copy) return false;
            const pid_t process = ::fork();
            must(process >= 0);
            if (process == 0) {
                become_copy(order);
                ++place.failed;
                return true;
            }
            must(::waitpid(process, &question.status, 0) == process);
        }
    }

private:
    void become_copy(const Order& order) {
        is_copy_ = true;
        ever_ = order.ever;
        ::close(socket_);
        ::alarm(120);
        move_to(folder_.c_str(), order.folder);
        redirect("stdout", STDOUT_FILENO);
        redirect("stderr", STDERR_FILENO);
    }

    CallPlaces& places_;
    Chosen chosen_;
    int socket_;
    std::string folder_;
    bool is_copy_ = false, ever_ = false;
};

/// Whether a file keeps its bytes as long as it has its name: it is written aside and renamed.
bool is_final(const fs::path& file) {
    const std::string name = file.string();
    return file.extension() == ".safetensors" && name.find(".part") == std::string::npos &&
           name.find(".unfinished") == std::string::npos;
}

void copy_output(const fs::path& from, const fs::path& to) {
    fs::create_directory(to);
    for (const auto& entry : fs::directory_iterator(from)) {
        const fs::path target = to / entry.path().filename();
        if (entry.is_directory()) {
            copy_output(entry.path(), target);
        } else if (is_final(entry.path())) {
            fs::create_hard_link(entry.path(), target);
        } else {
            fs::copy_file(entry.path(), target);
        }
    }
}

/// A folder in which a job's command with the output folder "out" can run.
class WorkingFolder {
public:
    WorkingFolder() {
        for (const auto& entry : fs::directory_iterator(short_data()))
            fs::create_symlink(entry.path(), disk_ / entry.path().filename().string());
    }
    [[nodiscard]] fs::path path() const { return fs::canonical(disk_.path()); }
    [[nodiscard]] fs::path out() const { return disk_ / "out"; }

private:
    ScratchFolder disk_;
};

/// Orders a copy of a tool and returns after its end.
int status_of_copy(int socket, const WorkingFolder& folder, bool ever) {
    Order order{.copy = true, .ever = ever, .folder = {}};
    std::strncpy(order.folder, folder.path().c_str(), sizeof order.folder - 1);
    Question question{};
    if (::write(socket, &order, sizeof order) != sizeof order ||
        ::read(socket, &question, sizeof question) != sizeof question)
        throw std::runtime_error("the tool has ended");
    return question.status;
}

}  // namespace

CallPlaces::CallPlaces()
    : table_(static_cast<Table*>(::mmap(nullptr, sizeof(Table), PROT_READ | PROT_WRITE,
                                        MAP_SHARED | MAP_ANONYMOUS, -1, 0))) {
    if (table_ == MAP_FAILED) throw std::bad_alloc();
}

CallPlaces::~CallPlaces() {
    ::munmap(table_, sizeof(Table));
}

CallPlace& CallPlaces::at(std::uint64_t stack) {
    auto& places = table_->places;
    std::size_t at = stack % places.size();
    while (places[at].stack != 0 && places[at].stack != stack) at = (at + 1) % places.size();
    if (places[at].stack == 0) {
        places[at].stack = stack;
        if (++table_->count + 1 >= static_cast<long>(places.size())) std::abort();
    }
    return places[at];
}

long CallPlaces::calls() const {
    long sum = 0;
    for (const CallPlace& place : table_->places) sum += place.calls;
    return sum;
}

long CallPlaces::failed() const {
    return std::ranges::count_if(table_->places,
                                 [](const auto& place) { return place.failed > 0; });
}

void count_calls(const ShortJob& job, const WatchedCalls& calls, CallPlaces& places) {
    const WorkingFolder folder;
    if (!job.beginning.empty()) copy_output(job.beginning, folder.out());
    CountingVisitor visitor(places);
    RunningCopy running(
        folder.path(), job.command + "out", [&] { watch_calls(calls, visitor); },
        stop_watching_calls);
    const ToolOutcome outcome = running.wait();
    INFO(outcome.err);
    REQUIRE(outcome.exit_code == 0);
}

void fail_in_copies(const ShortJob& job, const WatchedCalls& calls, CallPlaces& places,
                    Chosen chosen, bool ever, const std::function<void(const Branch&)>& visit) {
    const WorkingFolder whole;
    if (!job.beginning.empty()) copy_output(job.beginning, whole.out());
    int sockets[2];
    if (::socketpair(AF_UNIX, SOCK_SEQPACKET, 0, sockets) != 0)
        throw std::runtime_error("socketpair failed");
    const int here = sockets[0], there = sockets[1];
    BranchingVisitor visitor(places, chosen, there, whole.path());
    RunningCopy running(
        whole.path(), job.command + "out",
        [&] {
            ::close(here);
            watch_calls(calls, visitor);
        },
        stop_watching_calls);
    ::close(there);
    for (Question question{}; ::read(here, &question, sizeof question) == sizeof question;) {
        for (const bool later : {false, true}) {
            if (later && !ever) continue;
            const WorkingFolder folder;
            if (fs::exists(whole.out())) copy_output(whole.out(), folder.out());
            const int status = status_of_copy(here, folder, later);
            visit({.number = question.number,
                   .ever = later,
                   .outcome = {WIFEXITED(status) ? WEXITSTATUS(status) : -1,
                               read_file(folder.path() / "stdout"),
                               read_file(folder.path() / "stderr")},
                   .out = folder.out()});
        }
        const Order go_on{};
        if (::write(here, &go_on, sizeof go_on) != sizeof go_on) break;
    }
    ::close(here);
    const ToolOutcome outcome = running.wait();
    INFO(outcome.err);
    REQUIRE(outcome.exit_code == 0);
    job.compare(whole.out());  // no copy has disturbed it
}

}  // namespace stymo
