#pragma once

namespace stymo {

/// Calls a tool's main function. Errors that `CommandLine::run` does not see end the process with
/// one line on stderr and exit code 1, too: those while options are declared, and exceptions in
/// functions that may not throw. Libraries have such functions, and they do run out of memory.
/// `name` is the tool's and must outlive the process.
int guarded_main(int (*tool)(int, char**), const char* name, int argc, char** argv) noexcept;

}  // namespace stymo
