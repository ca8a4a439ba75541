#include "support/stability_check.h"

using namespace stymo;

TEST_CASE("Layers and losses: extreme inputs stay within their bounds or are refused by name",
          "[stability]") {
    stability::check(stability::layer_cases());
    stability::check(stability::loss_cases());
}

TEST_CASE("Renderer: hard and thin fields stay within their bounds", "[stability]") {
    stability::check(stability::renderer_cases());
}
