#include <catch2/catch.hpp>

#include "core/error.h"
#include "train/schedule.h"
#include "train/tiny_training.h"

using namespace stymo;
using namespace stymo::test;

namespace {

/// 5 steps of 2 images, then 3 (of 5 images), then 4 (of 8, fading for 4 of them).
TrainConfig config() {
    TrainConfig config = tiny_two_stage_config();
    config.stage1.steps = 5;
    config.stage2.images = {5, 8};
    return config;
}

}  // namespace

TEST_CASE("the phases follow each other in steps and in images", "[schedule]") {
    const TrainingSchedule schedule(config());
    REQUIRE(schedule.phases().size() == 3);
    const TrainingPhase& first = schedule.phases()[0];
    const TrainingPhase& second = schedule.phases()[1];
    const TrainingPhase& third = schedule.phases()[2];
    CHECK((first.stage == 1 && second.stage == 2 && third.stage == 2));
    CHECK((first.resolution == 128 && second.resolution == 64 && third.resolution == 128));
    CHECK((first.steps == 5 && second.steps == 3 && third.steps == 4));
    CHECK((first.first_step == 0 && second.first_step == 5 && third.first_step == 8));
    CHECK((first.first_image == 0 && second.first_image == 10 && third.first_image == 16));
    CHECK((second.r1_gamma == 0.1 && third.r1_gamma == 0.2));
    CHECK(schedule.steps() == 12);
    CHECK(schedule.images_before(12) == 24);
}

TEST_CASE("a step's position tells phase, images and fade", "[schedule]") {
    const TrainingSchedule schedule(config());
    const TrainingPosition last_of_second = schedule.position(7);
    CHECK(last_of_second.phase.resolution == 64);
    CHECK(last_of_second.step == 2);
    CHECK(last_of_second.first_image == 14);
    CHECK(last_of_second.fade == 1.0);
    CHECK(last_of_second.phase.micro_batches() == 2);
    const std::vector<double> fades{0.5, 1.0, 1.0, 1.0};
    for (std::size_t i = 0; i < fades.size(); ++i) {
        const TrainingPosition position = schedule.position(8 + static_cast<std::int64_t>(i));
        CHECK(position.phase.resolution == 128);
        CHECK(position.fade == fades[i]);
        CHECK(position.phase.micro_batches() == 1);
    }
    CHECK(schedule.position(0).phase.stage == 1);
    CHECK(schedule.position(12).phase.resolution == 128);
    CHECK_THROWS_AS(schedule.position(-1), ValueError);
}

TEST_CASE("a stage without steps is left out, but one phase always stays", "[schedule]") {
    TrainConfig without_first = config();
    without_first.stage1.steps = 0;
    const TrainingSchedule second_alone(without_first);
    CHECK(second_alone.phases().size() == 2);
    CHECK(second_alone.position(0).phase.stage == 2);

    TrainConfig nothing = without_first;
    nothing.stage2.resolutions = {};
    CHECK(TrainingSchedule(nothing).steps() == 0);
    CHECK(TrainingSchedule(nothing).position(0).phase.stage == 1);
}

TEST_CASE("the paper's second stage takes 64 to 512 pixels with batches of 32, 32, 16 and 12",
          "[schedule]") {
    const TrainingSchedule schedule{TrainConfig{}};
    std::vector<std::vector<std::int64_t>> phases;
    for (const TrainingPhase& phase : schedule.phases())
        phases.push_back({phase.resolution, phase.batch, phase.steps});
    CHECK(phases == std::vector<std::vector<std::int64_t>>{{512, 32, 200000},
                                                           {64, 32, 6250},
                                                           {128, 32, 9375},
                                                           {256, 16, 18750},
                                                           {512, 12, 41667}});
}
