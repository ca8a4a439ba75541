#include "apps/common/child_process.h"

#include <fcntl.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <memory>

#include "core/error.h"

namespace stymo {

namespace {

/// An unnamed file for the output, so that no thread has to read a pipe meanwhile.
class Capture {
public:
    Capture() : file_(std::tmpfile(), &std::fclose) {
        if (!file_) fail<Error>("no temporary file can be made: ", std::strerror(errno));
    }
    [[nodiscard]] int descriptor() const { return ::fileno(file_.get()); }
    [[nodiscard]] std::string text() const {
        std::rewind(file_.get());
        std::string text;
        char buffer[4096];
        for (std::size_t count = 0;
             (count = std::fread(buffer, 1, sizeof buffer, file_.get())) > 0;)
            text.append(buffer, count);
        return text;
    }

private:
    std::unique_ptr<std::FILE, int (*)(std::FILE*)> file_;
};

/// Null-terminated, as exec takes them.
std::vector<char*> pointers(std::vector<std::string>& words) {
    std::vector<char*> result;
    for (std::string& word : words) result.push_back(word.data());
    result.push_back(nullptr);
    return result;
}

std::vector<std::string> environment_with(const std::vector<std::string>& variables) {
    // If a name occurs twice, its first value counts.
    std::vector<std::string> all = variables;
    for (char** entry = environ; *entry != nullptr; ++entry) all.emplace_back(*entry);
    return all;
}

}  // namespace

ChildOutcome run_child(const std::vector<std::string>& words,
                       const std::vector<std::string>& variables) {
    constexpr int no_such_program = 127;
    std::vector<std::string> arguments = words, environment = environment_with(variables);
    const std::vector<char*> argument_pointers = pointers(arguments),
                             environment_pointers = pointers(environment);
    const Capture out, err;
    const pid_t parent = ::getpid();
    const pid_t child = ::fork();
    if (child < 0)
        fail<Error>("no process can be made for ", words.front(), ": ", std::strerror(errno));
    if (child == 0) {
        // Only functions that are allowed after a fork of a program with threads.
        ::prctl(PR_SET_PDEATHSIG, SIGKILL);
        if (::getppid() != parent) ::_exit(no_such_program);
        ::dup2(out.descriptor(), STDOUT_FILENO);
        ::dup2(err.descriptor(), STDERR_FILENO);
        ::execvpe(argument_pointers.front(), argument_pointers.data(), environment_pointers.data());
        ::_exit(no_such_program);
    }
    int status = 0;
    rusage usage{};
    while (::wait4(child, &status, 0, &usage) < 0 && errno == EINTR) {
    }
    constexpr double kibibytes_of_a_mebibyte = 1024.0;
    return {.exit_code = WIFEXITED(status) ? WEXITSTATUS(status) : -1,
            .out = out.text(),
            .err = err.text(),
            .peak_memory = static_cast<double>(usage.ru_maxrss) / kibibytes_of_a_mebibyte};
}

std::string own_program() {
    return std::filesystem::read_symlink("/proc/self/exe").string();
}

}  // namespace stymo
