#include <catch2/catch.hpp>
#include <limits>

#include "core/exact_text.h"
#include "support/grouping_locale.h"

using namespace stymo;

TEST_CASE("numbers are texts that are read back exactly, in every locale", "[exact_text]") {
    const test::GroupingLocale locale;
    CHECK(exact_text(1234567) == "1234567");
    CHECK(exact_text(std::numeric_limits<std::int64_t>::min()) == "-9223372036854775808");
    CHECK(exact_text(0.1) == "0.1");
    CHECK(exact_text(31.25F) == "31.25");
    CHECK(std::stod(exact_text(1.0 / 3.0)) == 1.0 / 3.0);
    CHECK(hexadecimal(0) == "0");
    CHECK(hexadecimal(0xadbeef) == "adbeef");
    CHECK(hexadecimal(0xadbeef, 8) == "00adbeef");
    CHECK(hexadecimal(0xffffffff, 8) == "ffffffff");
}
