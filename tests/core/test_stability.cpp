#include "support/stability_check.h"

using namespace stymo;

TEST_CASE("Elementary functions: extreme inputs stay within their bounds or are refused by name",
          "[stability]") {
    stability::check(stability::activation_cases());
}

TEST_CASE("Products: extreme inputs stay within their bounds", "[stability]") {
    stability::check(stability::product_cases());
}
