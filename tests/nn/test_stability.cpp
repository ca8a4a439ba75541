#include "support/stability_check.h"

using namespace stymo;

TEST_CASE("Layers and losses: extreme inputs stay within their bounds or are refused by name",
          "[stability]") {
    stability::check(stability::layer_cases());
    stability::check(stability::loss_cases());
}
