#include "apps/tool_run.h"

#include <fcntl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <iostream>
#include <map>
#include <sstream>
#include <stdexcept>
#include <thread>
#include <utility>

#include "apps/common/child_process.h"
#include "apps/common/process_setup.h"
#include "apps/common/tools.h"
#include "core/io/file.h"
#include "core/parallel.h"

// Defined by the leak sanitizer.
// NOLINTNEXTLINE(bugprone-reserved-identifier,readability-identifier-naming)
extern "C" [[gnu::weak]] int __lsan_do_recoverable_leak_check();

namespace stymo {

namespace {

void redirect(const std::filesystem::path& file, int stream) {
    const int opened = ::open(file.c_str(), O_WRONLY | O_TRUNC);
    ::dup2(opened, stream);
    ::close(opened);
}

/// The words of a command as argv wants them: the executable first, one thread unless the words say
/// otherwise, a null pointer last.
class ArgumentVector {
public:
    ArgumentVector(const std::string& tool, std::vector<std::string> arguments)
        : words_(std::move(arguments)) {
        words_.insert(words_.begin(), STYMO_BINARY_DIR "/bin/" + tool);
        if (std::ranges::find(words_, "--threads") == words_.end())
            words_.insert(words_.end(), {"--threads", "1"});
        for (std::string& word : words_) pointers_.push_back(word.data());
        pointers_.push_back(nullptr);
    }
    [[nodiscard]] int count() const { return static_cast<int>(words_.size()); }
    [[nodiscard]] char** pointers() { return pointers_.data(); }

private:
    std::vector<std::string> words_;
    std::vector<char*> pointers_;
};

/// While it lives, the working folder is `folder`, and what is written to a stream of this process
/// goes to a file.
class Surroundings {
public:
    Surroundings(const std::filesystem::path& folder, const std::filesystem::path& out,
                 const std::filesystem::path& err)
        : folder_(std::filesystem::current_path()), threads_(thread_count()) {
        flush();
        redirect(out, STDOUT_FILENO);
        redirect(err, STDERR_FILENO);
        std::filesystem::current_path(folder);
    }
    ~Surroundings() {
        flush();
        ::dup2(out_, STDOUT_FILENO);
        ::dup2(err_, STDERR_FILENO);
        ::close(out_);
        ::close(err_);
        std::error_code ignored;
        std::filesystem::current_path(folder_, ignored);
        set_thread_count(threads_);
    }
    Surroundings(const Surroundings&) = delete;
    Surroundings& operator=(const Surroundings&) = delete;

private:
    static void flush() {
        std::cout.flush();
        std::fflush(nullptr);
    }

    std::filesystem::path folder_;
    int threads_;
    int out_ = ::dup(STDOUT_FILENO);
    int err_ = ::dup(STDERR_FILENO);
};

using MainFunction = int (*)(int, char**);

/// The tool's main function, or null for a tool that has to be run as an executable: stymo-bench,
/// which starts itself.
MainFunction main_function(const std::string& tool) {
    static const std::map<std::string, MainFunction> functions{
        {"stymo-drive", stymo_drive},    {"stymo-edit", stymo_edit},
        {"stymo-eval", stymo_eval},      {"stymo-export", stymo_export},
        {"stymo-fit", stymo_fit},        {"stymo-prep", stymo_prep},
        {"stymo-render", stymo_render},  {"stymo-synth", stymo_synth},
        {"stymo-train", stymo_train},    {"stymo-view", stymo_view},
        {"stymo-weights", stymo_weights}};
    const auto found = functions.find(tool);
    return found == functions.end() ? nullptr : found->second;
}

}  // namespace

TemporaryFile::TemporaryFile() {
    std::string name = (std::filesystem::temp_directory_path() / "stymo-tool-XXXXXX").string();
    const int file = ::mkstemp(name.data());
    if (file < 0) throw std::runtime_error("mkstemp " + name);
    ::close(file);
    path_ = name;
}

TemporaryFile::~TemporaryFile() {
    std::error_code ignored;
    std::filesystem::remove(path_, ignored);
}

RunningTool::RunningTool(const std::filesystem::path& folder, const std::string& tool,
                         std::vector<std::string> arguments) {
    ArgumentVector argv(tool, std::move(arguments));
    process_ = ::fork();
    if (process_ == 0) {
        redirect(out_.path(), STDOUT_FILENO);
        redirect(err_.path(), STDERR_FILENO);
        if (::chdir(folder.c_str()) == 0) ::execv(argv.pointers()[0], argv.pointers());
        ::_exit(127);
    }
    if (process_ < 0) throw std::runtime_error("fork failed");
}

RunningTool::~RunningTool() {
    if (!has_ended()) {
        send(SIGKILL);
        ::waitpid(process_, &status_, 0);
    }
}

void RunningTool::send(int signal_number) const {
    ::kill(process_, signal_number);
}

bool RunningTool::has_ended() {
    ended_ = ended_ || ::waitpid(process_, &status_, WNOHANG) == process_;
    return ended_;
}

bool RunningTool::says(const std::string& text) {
    const auto end = std::chrono::steady_clock::now() + std::chrono::minutes(1);
    while (read_file(err_.path()).find(text) == std::string::npos) {
        if (has_ended() || std::chrono::steady_clock::now() > end) return false;
        std::this_thread::sleep_for(std::chrono::milliseconds(5));
    }
    return true;
}

ToolOutcome RunningTool::wait() {
    if (!ended_) ended_ = ::waitpid(process_, &status_, 0) == process_;
    return {WIFEXITED(status_) ? WEXITSTATUS(status_) : -1, read_file(out_.path()),
            read_file(err_.path())};
}

ToolOutcome run_tool(const std::filesystem::path& folder, const std::string& command) {
    std::vector<std::string> arguments = words(command);
    const std::string tool = arguments.front();
    arguments.erase(arguments.begin());
    const MainFunction main = main_function(tool);
    if (main == nullptr) return RunningTool(folder, tool, arguments).wait();
    const TemporaryFile out;
    const TemporaryFile err;
    ArgumentVector argv(tool, std::move(arguments));
    ToolOutcome outcome;
    {
        const Surroundings surroundings(folder, out.path(), err.path());
        outcome.exit_code = main(argv.count(), argv.pointers());
    }
    outcome.out = read_file(out.path());
    outcome.err = read_file(err.path());
    return outcome;
}

RunningCopy::RunningCopy(const std::filesystem::path& folder, const std::string& command,
                         const std::function<void()>& prepare,
                         const std::function<void()>& finish) {
    std::vector<std::string> arguments = words(command);
    const std::string tool = arguments.front();
    arguments.erase(arguments.begin());
    const MainFunction main = main_function(tool);
    if (main == nullptr) throw std::runtime_error(tool + " cannot run in a copy");
    std::cout.flush();
    std::fflush(nullptr);
    process_ = ::fork();
    if (process_ < 0) throw std::runtime_error("fork failed");
    if (process_ > 0) return;
    // An exception must not reach the tests of this copy.
    [&]() noexcept {
        ArgumentVector argv(tool, std::move(arguments));
        redirect(out_.path(), STDOUT_FILENO);
        redirect(err_.path(), STDERR_FILENO);
        if (::chdir(folder.c_str()) != 0) ::_exit(127);
        if (prepare) prepare();
        int code = guarded_main(main, tool.c_str(), argv.count(), argv.pointers());
        if (finish) finish();
        std::cout.flush();
        std::fflush(nullptr);
        if (__lsan_do_recoverable_leak_check != nullptr && __lsan_do_recoverable_leak_check() != 0)
            code = 23;
        // The objects of the tests are the other process's.
        ::_exit(code);
    }();
}

RunningCopy::~RunningCopy() {
    if (process_ < 0) return;
    ::kill(process_, SIGKILL);
    ::waitpid(process_, nullptr, 0);
}

ToolOutcome RunningCopy::wait() {
    int status = 0;
    ::waitpid(std::exchange(process_, -1), &status, 0);
    return {WIFEXITED(status) ? WEXITSTATUS(status) : -1, read_file(out_.path()),
            read_file(err_.path())};
}

bool can_start_ranks() {
#ifdef STYMO_WITH_MPI
    if (run_ranks({"mpirun", "-n", "1", "true"}).exit_code == 0) return true;
#endif
    std::cout << "skipped: no Open MPI, or mpirun cannot start a process here\n";
    return false;
}

ChildOutcome run_ranks(const std::vector<std::string>& words) {
    // Open MPI loses memory in libraries that it unloads, so that the leak sanitizer cannot be
    // told.
    return run_child(words, {"OMPI_ALLOW_RUN_AS_ROOT=1", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1",
                             "ASAN_OPTIONS=detect_leaks=0"});
}

std::vector<std::string> words(const std::string& line) {
    std::istringstream stream(line);
    std::vector<std::string> result;
    for (std::string word; stream >> word;) result.push_back(word);
    return result;
}

std::ptrdiff_t line_count(const std::string& text) {
    return std::count(text.begin(), text.end(), '\n');
}

}  // namespace stymo
