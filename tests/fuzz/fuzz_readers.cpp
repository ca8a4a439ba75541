// What libFuzzer calls. STYMO_FUZZ_READER names the reader.
#include <cstdint>
#include <cstdlib>
#include <iostream>
#include <string>

#include "core/error.h"
#include "core/parallel.h"
#include "fuzz/readers.h"

namespace {

const stymo::fuzz::Reader& chosen_reader() {
    const char* name = std::getenv("STYMO_FUZZ_READER");
    const auto found = stymo::fuzz::readers().find(name == nullptr ? "" : name);
    if (found != stymo::fuzz::readers().end()) return found->second;
    std::cerr << "STYMO_FUZZ_READER must be one of";
    for (const auto& [known, reader] : stymo::fuzz::readers()) std::cerr << ' ' << known;
    std::cerr << '\n';
    std::exit(2);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    static const stymo::fuzz::Reader& read = chosen_reader();
    static const bool on_one_thread = (stymo::set_thread_count(1), true);
    static_cast<void>(on_one_thread);
    try {
        read(std::string(reinterpret_cast<const char*>(data), size));
    } catch (const stymo::Error& error) {
        // Any other exception ends the program, as does a refusal without a word.
        if (*error.what() == '\0') std::abort();
    }
    return 0;
}
