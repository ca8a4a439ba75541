#include "support/stability_check.h"

using namespace stymo;

TEST_CASE("Rays and cameras: extreme inputs stay within their bounds or are refused by name",
          "[stability]") {
    stability::check(stability::ray_cases());
    stability::check(stability::camera_cases());
}
