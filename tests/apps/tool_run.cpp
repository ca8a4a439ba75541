#include "apps/tool_run.h"

#include <fcntl.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <iostream>
#include <map>
#include <sstream>
#include <stdexcept>
#include <thread>

#include "apps/common/tools.h"
#include "core/io/file.h"

namespace stymo {

namespace {

/// A new file in the folder for temporary files.
std::filesystem::path new_file() {
    std::string name = (std::filesystem::temp_directory_path() / "stymo-tool-XXXXXX").string();
    const int file = ::mkstemp(name.data());
    if (file < 0) throw std::runtime_error("mkstemp " + name);
    ::close(file);
    return name;
}

void redirect(const std::filesystem::path& file, int stream) {
    const int opened = ::open(file.c_str(), O_WRONLY | O_TRUNC);
    ::dup2(opened, stream);
    ::close(opened);
}

/// Becomes the tool: words are files for stdout and stderr, the folder, the tool and its arguments.
[[noreturn]] void become_tool(std::vector<std::string> words) {
    static const std::map<std::string, int (*)(int, char**)> functions{
        {"stymo-edit", stymo_edit},   {"stymo-eval", stymo_eval},      {"stymo-fit", stymo_fit},
        {"stymo-prep", stymo_prep},   {"stymo-render", stymo_render},  {"stymo-synth", stymo_synth},
        {"stymo-train", stymo_train}, {"stymo-weights", stymo_weights}};
    redirect(words[0], STDOUT_FILENO);
    redirect(words[1], STDERR_FILENO);
    if (::chdir(words[2].c_str()) != 0) ::_exit(127);
    const std::string tool = words[3];
    words[3] = STYMO_BINARY_DIR "/bin/" + tool;
    std::vector<char*> pointers;
    for (auto word = words.begin() + 3; word != words.end(); ++word)
        pointers.push_back(word->data());
    pointers.push_back(nullptr);
    const bool version = std::ranges::find(words, "--version") != words.end();
    if (const auto found = functions.find(tool); found != functions.end() && !version) {
        const int code = found->second(static_cast<int>(pointers.size()) - 1, pointers.data());
        // No exit handlers: those of libraries wait for threads that a fork leaves behind.
        std::cout.flush();
        std::fflush(nullptr);
        ::_exit(code);
    }
    ::execv(pointers[0], pointers.data());
    ::_exit(127);
}

/// A process that makes the tools' processes. It is forked before main(), while this program has a
/// single thread; OpenMP does not survive a fork of a program that has used it.
class ToolServer {
public:
    ToolServer() {
        int ends[2];
        if (::socketpair(AF_UNIX, SOCK_SEQPACKET, 0, ends) != 0) std::abort();
        socket_ = ends[0];
        if (::fork() == 0) {
            ::close(ends[0]);
            serve(ends[1]);
        }
        ::close(ends[1]);
        ::prctl(PR_SET_CHILD_SUBREAPER, 1);
    }

    [[nodiscard]] pid_t start(const std::vector<std::string>& words) const {
        std::string message;
        for (const std::string& word : words) message += word + '\0';
        pid_t process = -1;
        if (::send(socket_, message.data(), message.size(), MSG_NOSIGNAL) < 0 ||
            ::recv(socket_, &process, sizeof process, 0) != sizeof process || process < 0)
            throw std::runtime_error("no process for " + words[3]);
        return process;
    }

private:
    [[noreturn]] static void serve(int socket) {
        std::vector<char> buffer(1 << 16);
        // Shared with the process in between.
        auto* process = static_cast<pid_t*>(::mmap(nullptr, sizeof(pid_t), PROT_READ | PROT_WRITE,
                                                   MAP_SHARED | MAP_ANONYMOUS, -1, 0));
        for (;;) {
            const ssize_t size = ::recv(socket, buffer.data(), buffer.size(), 0);
            if (size <= 0) ::_exit(0);
            std::vector<std::string> words;
            std::istringstream message(std::string(buffer.data(), static_cast<std::size_t>(size)));
            for (std::string word; std::getline(message, word, '\0');) words.push_back(word);
            // An orphan becomes a child of the tests, which wait for it (see
            // PR_SET_CHILD_SUBREAPER).
            const pid_t between = ::fork();
            if (between == 0) {
                const pid_t child = ::fork();
                if (child != 0) {
                    *process = child;
                    ::_exit(0);
                }
                ::close(socket);
                become_tool(std::move(words));
            }
            ::waitpid(between, nullptr, 0);
            ::send(socket, process, sizeof *process, MSG_NOSIGNAL);
        }
    }

    int socket_ = -1;
};

const ToolServer server;

}  // namespace

RunningTool::RunningTool(const std::filesystem::path& folder, const std::string& tool,
                         std::vector<std::string> arguments)
    : out_(new_file()), err_(new_file()) {
    if (std::ranges::find(arguments, "--threads") == arguments.end())
        arguments.insert(arguments.end(), {"--threads", "1"});
    arguments.insert(arguments.begin(), {out_.string(), err_.string(), folder.string(), tool});
    process_ = server.start(arguments);
}

RunningTool::~RunningTool() {
    if (!has_ended()) {
        send(SIGKILL);
        ::waitpid(process_, &status_, 0);
    }
    std::error_code ignored;
    std::filesystem::remove(out_, ignored);
    std::filesystem::remove(err_, ignored);
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
    while (read_text_file(err_).find(text) == std::string::npos) {
        if (has_ended() || std::chrono::steady_clock::now() > end) return false;
        std::this_thread::sleep_for(std::chrono::milliseconds(5));
    }
    return true;
}

ToolOutcome RunningTool::wait() {
    if (!ended_) ended_ = ::waitpid(process_, &status_, 0) == process_;
    return {WIFEXITED(status_) ? WEXITSTATUS(status_) : -1, read_text_file(out_),
            read_text_file(err_)};
}

ToolOutcome run_tool(const std::filesystem::path& folder, const std::string& command) {
    std::vector<std::string> arguments = words(command);
    const std::string tool = arguments.front();
    arguments.erase(arguments.begin());
    return RunningTool(folder, tool, arguments).wait();
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
