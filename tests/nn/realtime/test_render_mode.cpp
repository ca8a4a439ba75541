#include <catch2/catch.hpp>
#include <set>

#include "core/matmul_precision.h"
#include "nn/realtime/render_mode.h"

using namespace stymo;

TEST_CASE("every mode of rendering has a name, a help and its own row", "[realtime]") {
    std::set<std::string_view> names;
    for (const RenderModeTraits& mode : render_modes()) {
        CHECK(&traits_of(mode.mode) == &mode);
        CHECK(names.insert(mode.name).second);
        CHECK_FALSE(mode.help.empty());
    }
    CHECK(name_of(RenderMode::skip) == "skip");
}

TEST_CASE("a mode says whether it leaves out samples", "[realtime]") {
    CHECK_FALSE(tolerates(RenderMode::exact));
    CHECK(tolerates(RenderMode::skip));
    for (const auto& [precision, of_skip] :
         {std::pair{MatmulPrecision::highest, MatmulPrecision::highest},
          {MatmulPrecision::high, MatmulPrecision::medium},
          {MatmulPrecision::medium, MatmulPrecision::medium}}) {
        const PrecisionScope of_process(precision);
        CHECK(products_of(RenderMode::skip) == of_skip);
        CHECK(products_of(RenderMode::exact) == precision);
    }
}
