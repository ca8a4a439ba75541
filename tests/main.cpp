#define CATCH_CONFIG_RUNNER
#include <catch2/catch.hpp>
#include <iostream>

#include "core/autograd/node.h"

int main(int argc, char** argv) {
    const int failed = Catch::Session().run(argc, argv);
    if (const auto live = stymo::Node::live_count(); live != 0) {
        std::cerr << live << " nodes of graphs are alive after the last test\n";
        return 1;
    }
    return failed;
}
