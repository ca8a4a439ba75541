#include "apps/tool_run.h"

#include <fcntl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <csignal>
#include <sstream>
#include <stdexcept>
#include <thread>

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

}  // namespace

RunningTool::RunningTool(const std::filesystem::path& folder, const std::string& tool, std::vector<std::string> arguments)
    : out_(new_file()), err_(new_file()) {
    arguments.insert(arguments.begin(), STYMO_BINARY_DIR "/bin/" + tool);
    if (std::ranges::find(arguments, "--threads") == arguments.end()) arguments.insert(arguments.end(), {"--threads", "1"});
    std::vector<char*> pointers;
    for (std::string& argument : arguments) pointers.push_back(argument.data());
    pointers.push_back(nullptr);
    process_ = ::fork();
    if (process_ == 0) {
        redirect(out_, STDOUT_FILENO);
        redirect(err_, STDERR_FILENO);
        if (::chdir(folder.c_str()) == 0) ::execv(pointers[0], pointers.data());
        ::_exit(127);
    }
    if (process_ < 0) throw std::runtime_error("fork failed");
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
    return {WIFEXITED(status_) ? WEXITSTATUS(status_) : -1, read_text_file(out_), read_text_file(err_)};
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
