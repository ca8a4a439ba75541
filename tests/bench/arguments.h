#pragma once

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "core/clock.h"
#include "core/error.h"
#include "core/median.h"

/// What the programs that measure ops and products share.
namespace stymo::test {

struct Arguments {
    std::string filter;  ///< only rows whose names contain it
    int threads = 0;     ///< 0: one per processor
    int repeats = 9;
};

/// Reads "--filter TEXT --threads N --repeats N". Throws ValueError for anything else.
inline Arguments parse(const std::vector<std::string_view>& words) {
    Arguments arguments;
    for (std::size_t i = 0; i < words.size(); i += 2) {
        if (i + 1 == words.size()) fail<ValueError>(words[i], " needs a value");
        const std::string value(words[i + 1]);
        if (words[i] == "--filter") {
            arguments.filter = value;
        } else if (words[i] == "--threads") {
            arguments.threads = std::atoi(value.c_str());
        } else if (words[i] == "--repeats") {
            arguments.repeats = std::max(1, std::atoi(value.c_str()));
        } else {
            fail<ValueError>("unknown option ", words[i],
                             "; there are --filter TEXT, --threads N, --repeats N");
        }
    }
    return arguments;
}

/// The median seconds of each function. They are called once without timing, then by turns.
inline std::vector<double> median_seconds(int repeats,
                                          const std::vector<std::function<void()>>& functions) {
    for (const auto& each : functions) each();
    std::vector<std::vector<double>> seconds(functions.size());
    for (int i = 0; i < repeats; ++i) {
        for (std::size_t k = 0; k < functions.size(); ++k) {
            const double start = seconds_now();
            functions[k]();
            seconds[k].push_back(seconds_now() - start);
        }
    }
    std::vector<double> medians;
    for (std::vector<double>& each : seconds) medians.push_back(median(std::move(each)));
    return medians;
}

/// The main function of `program`: an exception ends it with a line on stderr and exit code 1.
inline int run_program(const char* program, int argument_count, char** arguments,
                       void (*run)(const Arguments&)) {
    try {
        run(parse({arguments + 1, arguments + argument_count}));
        return 0;
    } catch (const std::exception& error) {
        std::fprintf(stderr, "%s: %s\n", program, error.what());
        return 1;
    }
}

}  // namespace stymo::test
