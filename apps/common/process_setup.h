#pragma once

#include <string>

/// What a tool sets in its own process before it works.
namespace stymo {

/// Makes waiting OpenMP threads spin only for some microseconds before they sleep, unless the
/// environment sets another policy (docs/decisions.md). GNU's OpenMP reads its policy before
/// `main`, so the program executes itself again with GOMP_SPINCOUNT set, which takes as long as
/// loading its libraries. If that fails, or if the program is only asked for help, it continues
/// without. `argv` is that of `main`.
void shorten_spinning(char** argv);

/// Calls a tool's main function. Errors that `CommandLine::run` does not see end the process with
/// one line on stderr and exit code 1, too: those while options are declared, and exceptions in
/// functions that may not throw. Libraries have such functions, and they do run out of memory.
/// `name` is the tool's and must outlive the process.
int guarded_main(int (*tool)(int, char**), const char* name, int argc, char** argv) noexcept;

/// Configures the C library's allocator for a process that repeatedly frees and allocates the same
/// large buffers.
void tune_allocator();

/// The name of this machine in its network, for messages; "unknown host" if it has none.
[[nodiscard]] std::string host_name();

}  // namespace stymo
