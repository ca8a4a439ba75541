#include "support/stability_check.h"

using namespace stymo;

TEST_CASE("Fitting: extreme inputs stay within their bounds or are refused by name",
          "[stability]") {
    stability::check(stability::fitting_cases());
}
