#include "support/stability_check.h"

using namespace stymo;

TEST_CASE("Optimisation: extreme inputs stay within their bounds or are refused by name",
          "[stability]") {
    stability::check(stability::training_cases());
}
