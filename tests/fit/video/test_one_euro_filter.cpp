// The filter of landmarks and eyes, against closed forms.
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <numbers>

#include "fit/video/one_euro_filter.h"

using namespace stymo;

TEST_CASE("the filter keeps a point at rest, smooths noise, and lags as it says", "[video]") {
    OneEuroFilter<3> still;
    const Eigen::Vector3d place(0.1, 0.2, 0.5);
    for (int i = 0; i < 50; ++i) CHECK((still(place, i / 30.0) - place).norm() < 1e-12);

    OneEuroFilter<3> noisy;
    double noise = 0.0;
    for (int i = 0; i < 300; ++i) {
        const double sign = i % 2 == 0 ? 1.0 : -1.0;
        const Eigen::Vector3d filtered =
            noisy(place + Eigen::Vector3d(0.005 * sign, 0.0, 0.0), i / 30.0);
        if (i > 100) noise = std::max(noise, (filtered - place).norm());
    }
    CHECK(noise < 0.0015);  // of 0.005

    OneEuroFilter<3> moving;
    const double speed = 0.4, rate = 240.0;  // metres a second
    Eigen::Vector3d filtered = Eigen::Vector3d::Zero();
    const int last = 2000;
    for (int i = 0; i <= last; ++i)
        filtered = moving(Eigen::Vector3d(speed * i / rate, 0.0, 0.0), i / rate);
    const double behind = last / rate - filtered[0] / speed;
    CHECK(behind == Approx(moving.lag()).epsilon(0.02));
    CHECK(moving.lag() ==
          Approx(1.0 / (2.0 * std::numbers::pi * (1.0 + 2.0 * speed))).epsilon(0.02));
}

TEST_CASE("a speed from the filtered point lags less behind steady motion", "[video]") {
    // At a steady lag of L seconds the filter moves by its weight w of the distance v * (L + dt) in
    // each interval dt, and must move by v * dt: so its cutoff is 1 / (2 pi L).
    const OneEuroSettings settings{.speed_from_filtered = true};
    OneEuroFilter<3> filter(settings);
    const double speed = 0.4, rate = 30.0;
    const int last = 2000;
    Eigen::Vector3d filtered = Eigen::Vector3d::Zero();
    for (int i = 0; i <= last; ++i)
        filtered = filter(Eigen::Vector3d(speed * i / rate, 0.0, 0.0), i / rate);
    const double behind = last / rate - filtered[0] / speed;
    CHECK(behind == Approx(filter.lag()).epsilon(1e-6));
    const double seen = speed * (1.0 + behind * rate);
    const double cutoff = settings.least_cutoff + settings.speed_factor * seen;
    CHECK(1.0 / (2.0 * std::numbers::pi * behind) == Approx(cutoff).epsilon(1e-6));

    filter.reset();
    const Eigen::Vector3d place(1.0, 2.0, 3.0);
    CHECK(filter(place, 100.0) == place);
    CHECK(filter(place * 2.0, 100.0) == place);
}
