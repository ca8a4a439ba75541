#include <catch2/catch.hpp>

#include "core/io/image.h"
#include "fit/edit/style_mix.h"
#include "nn/realtime/view.h"
#include "support/check_close.h"
#include "support/error_message.h"
#include "support/tiny_model.h"

using namespace stymo;
using namespace stymo::test;

namespace {

CodeFile face_of(std::uint64_t seed, double yaw) {
    return {random_codes(1, seed), pivot_pose(yaw, 0.0, 0.0, 5.3, 0.9)};
}

Tensor shown(const Model& model, const Codes& codes, const Pose& pose) {
    return render_view(model, codes, 0, camera_from_pose(pose, model.config().camera.intrinsics),
                       {.samples_per_ray = 4})
        .image;
}

Tensor tile(const Tensor& sheet, std::int64_t row, std::int64_t column) {
    return image_part(sheet, 16 * row, 16 * column, 16, 16);
}

}  // namespace

TEST_CASE("a mixed face has the groups that are taken from the source, and the target's others",
          "[style_mix]") {
    const Codes source = random_codes(2, 1);
    const Codes target = random_codes(2, 2);
    const Codes mixed = mix_codes(target, source, {false, true, false, true});
    for (std::size_t group = 0; group < code_names.size(); ++group) {
        const Codes& from = group == 1 || group == 3 ? source : target;
        CHECK(identical(mixed.groups[group].value(), from.groups[group].value()));
    }
    CHECK_THAT(error_message<ShapeError>([&] { return mix_codes(target, random_codes(1, 1), {}); }),
               Catch::Contains("2 targets"));
}

TEST_CASE("a sheet of mixed faces has sources down, targets across and a block for each group",
          "[style_mix]") {
    const Model model = tiny_model();
    const std::vector<CodeFile> sources{face_of(1, 0.1), face_of(2, -0.2)};
    const std::vector<CodeFile> targets{face_of(3, 0.0), face_of(4, 0.3), face_of(5, -0.1)};
    const std::vector<CodeGroups> blocks{{false, true, false, false}, {false, false, true, true}};
    const Tensor sheet = mixing_sheet(model, sources, targets, blocks, 4);
    REQUIRE(sheet.shape() == Shape{16 * 3, 16 * 8, 3});
    CHECK(identical(tile(sheet, 0, 0), Tensor::zeros({16, 16, 3})));
    CHECK(identical(tile(sheet, 2, 4), Tensor::zeros({16, 16, 3})));
    for (std::int64_t row = 0; row < 2; ++row) {
        const CodeFile& source = sources[static_cast<std::size_t>(row)];
        CHECK(check_close(tile(sheet, row + 1, 0), shown(model, source.codes, source.pose), 1e-6)
                  .passed);
        for (std::int64_t block = 0; block < 2; ++block)
            for (std::int64_t column = 0; column < 3; ++column) {
                const CodeFile& target = targets[static_cast<std::size_t>(column)];
                const Codes mixed =
                    mix_codes(target.codes, source.codes, blocks[static_cast<std::size_t>(block)]);
                CHECK(check_close(tile(sheet, 0, 1 + 4 * block + column),
                                  shown(model, target.codes, target.pose), 1e-6)
                          .passed);
                CHECK(check_close(tile(sheet, row + 1, 1 + 4 * block + column),
                                  shown(model, mixed, target.pose), 1e-6)
                          .passed);
            }
    }
    CHECK_THROWS_AS(mixing_sheet(model, {}, targets, blocks, 4), ValueError);
}
