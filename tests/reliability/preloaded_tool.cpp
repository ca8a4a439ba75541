#include "reliability/preloaded_tool.h"

#include <cstdlib>

namespace stymo {

namespace {

/// Sets variables of this process, which those it starts inherit.
class Surroundings {
public:
    explicit Surroundings(Environment environment) : environment_(std::move(environment)) {
        for (const auto& [name, value] : environment_) ::setenv(name.c_str(), value.c_str(), 1);
    }
    Surroundings(const Surroundings&) = delete;
    Surroundings& operator=(const Surroundings&) = delete;
    ~Surroundings() {
        for (const auto& [name, value] : environment_) ::unsetenv(name.c_str());
    }

private:
    Environment environment_;
};

}  // namespace

ToolOutcome run_preloaded(const std::string& library, const Environment& environment,
                          const std::filesystem::path& folder, const std::string& command) {
    std::vector<std::string> arguments = words(command);
    const std::string tool = arguments.front();
    arguments.erase(arguments.begin());
    Environment whole = environment;
    whole.emplace_back("LD_PRELOAD", STYMO_BINARY_DIR "/tests/lib" + library + ".so");
    // Else the tool starts itself again to set it.
    whole.emplace_back("GOMP_SPINCOUNT", "1000");
    const Surroundings surroundings(std::move(whole));
    RunningTool running(folder, tool, arguments);
    return running.wait();
}

}  // namespace stymo
