#include "fit/edit/style_mix.h"

#include <algorithm>
#include <cmath>
#include <sstream>

#include "core/error.h"
#include "core/io/image.h"
#include "core/ops/ops.h"
#include "nn/realtime/view.h"
#include "render/soft_edge.h"

namespace stymo {

namespace {

/// The image of `codes` in the pose of a face.
Tensor shown(const Model& model, const Codes& codes, const Pose& pose,
             std::int64_t samples_per_ray) {
    const Camera camera = camera_from_pose(pose, model.config().camera.intrinsics);
    const View seen =
        render_view(model, codes, 0, camera, {.samples_per_ray = samples_per_ray, .mask = true});
    return with_soft_edge(seen.image, seen.mask);
}

constexpr std::size_t groups = code_names.size();

double root_mean_square(const Variable& from, const Variable& to) {
    if (!(from.shape() == to.shape()))
        fail<ShapeError>("disentanglement: codes ", from.shape(), " and ", to.shape(),
                         " differ in shape");
    return std::sqrt(sum(square(to - from)).value().item() / static_cast<double>(from.shape(0)));
}

}  // namespace

CodeGroups code_groups_of(const std::string& list) {
    CodeGroups taken{};
    std::istringstream stream(list);
    for (std::string name; std::getline(stream, name, ',');) {
        const auto* const found = std::ranges::find(code_names, name);
        if (found == code_names.end())
            fail<ValueError>("\"", name,
                             "\" is no group of codes; there are id, expr, tex and light");
        taken[static_cast<std::size_t>(found - code_names.begin())] = true;
    }
    if (taken == CodeGroups{})
        fail<ValueError>("no group of codes is named; there are id, expr, tex and light");
    return taken;
}

Codes mix_codes(const Codes& target, const Codes& source, const CodeGroups& taken) {
    if (target.batch() != source.batch())
        fail<ShapeError>("mixing: ", source.batch(), " sources for ", target.batch(),
                         " targets; give as many");
    Codes mixed = target;
    for (std::size_t group = 0; group < taken.size(); ++group)
        if (taken[group]) mixed.groups[group] = source.groups[group];
    return mixed;
}

Tensor mixing_sheet(const Model& model, std::span<const CodeFile> sources,
                    std::span<const CodeFile> targets, std::span<const CodeGroups> blocks,
                    std::int64_t samples_per_ray) {
    if (sources.empty() || targets.empty() || blocks.empty())
        fail<ValueError>("a sheet of mixed faces needs a source, a target and a group to take");
    const std::int64_t side = model.config().decoder.resolution;
    const Tensor gap = Tensor::zeros({side, side, 3});
    std::vector<Tensor> top;
    for (const CodeFile& target : targets)
        top.push_back(shown(model, target.codes, target.pose, samples_per_ray));
    std::vector<Tensor> tiles{gap};
    const auto begin_block = [&](std::size_t block) {
        if (block > 0) tiles.push_back(gap);
    };
    for (std::size_t block = 0; block < blocks.size(); ++block) {
        begin_block(block);
        tiles.insert(tiles.end(), top.begin(), top.end());
    }
    for (const CodeFile& source : sources) {
        tiles.push_back(shown(model, source.codes, source.pose, samples_per_ray));
        for (std::size_t block = 0; block < blocks.size(); ++block) {
            begin_block(block);
            for (const CodeFile& target : targets)
                tiles.push_back(shown(model, mix_codes(target.codes, source.codes, blocks[block]),
                                      target.pose, samples_per_ray));
        }
    }
    return tile_images(tiles, static_cast<int>(blocks.size() * (targets.size() + 1)));
}

GroupMatrix group_movements(const Codes& base, const Codes& other,
                            const std::array<Codes, groups>& changed) {
    GroupMatrix result{};
    for (std::size_t read = 0; read < groups; ++read) {
        const double whole = root_mean_square(base.groups[read], other.groups[read]);
        if (!(whole > 0.0))
            fail<NumericError>("disentanglement: the encoder reads the same ", code_names[read],
                               " codes of all faces");
        for (std::size_t replaced = 0; replaced < groups; ++replaced)
            result[replaced][read] =
                root_mean_square(base.groups[read], changed[replaced].groups[read]) / whole;
    }
    return result;
}

std::array<double, groups> largest_leaks(const GroupMatrix& movements) {
    std::array<double, groups> result{};
    for (std::size_t row = 0; row < groups; ++row) {
        if (!(movements[row][row] > 0.0))
            fail<NumericError>("disentanglement: the encoder does not see that the ",
                               code_names[row], " code was replaced");
        for (std::size_t column = 0; column < groups; ++column)
            if (column != row)
                result[row] = std::max(result[row], movements[row][column] / movements[row][row]);
    }
    return result;
}

}  // namespace stymo
