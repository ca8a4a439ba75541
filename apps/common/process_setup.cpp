#include "apps/common/process_setup.h"

#include <unistd.h>

#include <array>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <exception>
#include <filesystem>
#include <iostream>
#include <new>
#include <string_view>
#include <system_error>

// Any standard header defines __GLIBC__ if this is the GNU library.
#ifdef __GLIBC__
#include <malloc.h>
#endif

namespace stymo {

namespace {

const char* tool_name = "stymo";

/// Ends the process as an error of the tool does. Nothing here allocates.
[[noreturn]] void end_with_one_line() noexcept {
    try {
        if (std::current_exception()) throw;
        std::cerr << tool_name << ": ended by a fault of its own\n";
    } catch (const std::bad_alloc&) {
        std::cerr << tool_name << ": out of memory; choose a smaller size or batch\n";
    } catch (const std::exception& error) {
        std::cerr << tool_name << ": " << error.what() << '\n';
    } catch (...) {
        std::cerr << tool_name << ": ended by an unknown error\n";
    }
    ::_exit(1);
}

/// Says in a line what ends the process, and lets it end so.
extern "C" void end_by_signal(int number) {
    constexpr std::string_view text = ": interrupted\n";
    static_cast<void>(::write(STDERR_FILENO, tool_name, std::strlen(tool_name)) < 0);
    static_cast<void>(::write(STDERR_FILENO, text.data(), text.size()) < 0);
    ::raise(number);
}

/// Loops that can end in order replace these handlers (InterruptGuard).
void say_signals() {
    struct sigaction action {};
    action.sa_handler = end_by_signal;
    action.sa_flags = static_cast<int>(SA_RESETHAND);
    for (const int number : {SIGINT, SIGTERM}) {
        struct sigaction former {};
        sigaction(number, nullptr, &former);
        if (former.sa_handler == SIG_DFL) sigaction(number, &action, nullptr);
    }
}

}  // namespace

void shorten_spinning(char** argv) {
    for (const char* name : {"OMP_WAIT_POLICY", "GOMP_SPINCOUNT"})
        if (std::getenv(name) != nullptr) return;
    for (char** argument = argv; *argument != nullptr; ++argument) {
        const std::string_view word = *argument;
        if (word == "--help" || word == "-h" || word == "--version") return;
    }
    // The link's target, because the process takes its name from the path that it is started by.
    std::error_code error;
    const std::filesystem::path program = std::filesystem::read_symlink("/proc/self/exe", error);
    if (!error && ::setenv("GOMP_SPINCOUNT", "1000", 1) == 0) ::execv(program.c_str(), argv);
}

int guarded_main(int (*tool)(int, char**), const char* name, int argc, char** argv) noexcept {
    tool_name = name;
    std::set_terminate(end_with_one_line);
    say_signals();
    // What leaves a function that may not throw ends in the handler.
    return tool(argc, argv);
}

void tune_allocator() {
#ifdef __GLIBC__
    // By default a buffer above 32 MB is mapped when it is allocated and unmapped when it is freed,
    // so that every op pays for a page fault and a cleared page per 4 KiB of its result. With these
    // settings the pages stay in the heap and are reused.
    mallopt(M_MMAP_MAX, 0);
    mallopt(M_TRIM_THRESHOLD, -1);  // never hand the top of the heap back
    mallopt(M_TOP_PAD, 64 << 20);
#endif
}

std::string host_name() {
    std::array<char, 256> name{};
    return ::gethostname(name.data(), name.size() - 1) == 0 ? name.data() : "unknown host";
}

}  // namespace stymo
