#include "fit/edit/style_mix.h"

#include "core/error.h"
#include "core/io/image.h"
#include "nn/realtime/view.h"

namespace stymo {

namespace {

/// The image of `codes` in the pose of a face.
Tensor shown(const Model& model, const Codes& codes, const Pose& pose,
             std::int64_t samples_per_ray) {
    const Camera camera = camera_from_pose(pose, model.config().camera.intrinsics);
    return render_view(model, codes, 0, camera, {.samples_per_ray = samples_per_ray}).image;
}

}  // namespace

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

}  // namespace stymo
