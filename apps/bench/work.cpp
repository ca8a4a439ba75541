#include "apps/bench/work.h"

#include <algorithm>

#include "nn/pretrained/perceptual/trunk.h"

namespace stymo {

namespace {

double area(std::int64_t side) {
    return static_cast<double>(side * side);
}

}  // namespace

double FrameWork::of_field(std::int64_t samples_per_ray) const {
    return rays * (field_sample * static_cast<double>(samples_per_ray) + ray);
}

FrameWork frame_work(const Model& model, std::int64_t resolution) {
    const DecoderWork work = model.decoder().work(resolution);
    return {.field_sample = static_cast<double>(work.field.sample),
            .ray = static_cast<double>(work.field.ray),
            .blocks = static_cast<double>(work.blocks),
            .rays = static_cast<double>(work.rays)};
}

double trunk_work(const std::string& network, std::int64_t side) {
    const auto& all = trunk_descriptions();
    const auto description = std::ranges::find(all, network, &TrunkDescription::name);
    double work = 0.0;
    std::int64_t channels = 3;
    for (const TrunkLayer& layer : description->layers) {
        if (layer.kind == TrunkLayer::Kind::fire) {
            // 1x1 to the squeezed channels, then 1x1 and 3x3 to half of the output each.
            constexpr std::int64_t taps = 1 + 3 * 3;
            work += area(side) *
                    static_cast<double>(layer.squeezed * (channels + taps * layer.out / 2));
            channels = layer.out;
            continue;
        }
        side = (side + 2 * layer.padding - layer.kernel) / layer.stride + 1;
        if (layer.kind == TrunkLayer::Kind::max_pool) continue;
        work += area(side * layer.kernel) * static_cast<double>(channels * layer.out);
        channels = layer.out;
    }
    return work;
}

double discriminator_work(const ParameterStore& discriminator, const std::string& prefix,
                          std::int64_t side) {
    const auto weights = [&](const std::string& layer) {
        const std::string name = prefix + "." + layer + ".weight";
        const auto found = std::ranges::find(discriminator.all(), name, &Parameter::name);
        return found == discriminator.all().end()
                   ? 0.0
                   : static_cast<double>(found->variable().value().size());
    };
    double work = area(side) * weights("from_rgb" + std::to_string(side));
    constexpr std::int64_t final_side = 4;
    for (std::int64_t s = side; s > final_side; s /= 2) {
        const std::string block = "block" + std::to_string(s);
        work += area(s) * weights(block + ".conv0") +
                area(s / 2) * (weights(block + ".conv1") + weights(block + ".skip"));
    }
    return work + area(final_side) * weights("epilogue.conv") + weights("epilogue.hidden") +
           weights("epilogue.logit");
}

}  // namespace stymo
