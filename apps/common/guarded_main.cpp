#include "apps/common/guarded_main.h"

#include <unistd.h>

#include <exception>
#include <iostream>
#include <new>

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

}  // namespace

int guarded_main(int (*tool)(int, char**), const char* name, int argc, char** argv) noexcept {
    tool_name = name;
    std::set_terminate(end_with_one_line);
    // What leaves a function that may not throw ends in the handler.
    return tool(argc, argv);
}

}  // namespace stymo
