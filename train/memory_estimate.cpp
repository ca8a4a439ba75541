#include "train/memory_estimate.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <string_view>

#include "core/error.h"

namespace stymo {

namespace {

constexpr std::int64_t bytes_per_number = 4;
constexpr double gibibyte = 1024.0 * 1024.0 * 1024.0;
/// Program and libraries.
constexpr std::int64_t program_bytes = 120 << 20;
/// What the heap takes for what a step asks of it: freed pieces do not always fit the next request.
constexpr double heap_factor = 1.15;
/// Sums of the field's weight gradients, of one face at a time (core/kernels/sine_rays.cpp).
constexpr std::int64_t field_sums = 16;
/// A step that is chosen to fit a budget stays within it where the estimate is too low by as much.
constexpr double estimate_margin = 1.25;

std::int64_t square(std::int64_t side) {
    return side * side;
}

/// Numbers of weights, and numbers saved for the backward pass of one image.
struct NetworkSize {
    std::string_view name;
    std::int64_t weights;
    std::int64_t saved;
    std::int64_t embedding = 512;
};

NetworkSize size_of(std::span<const NetworkSize> sizes, std::string_view name) {
    const auto found = std::ranges::find(sizes, name, &NetworkSize::name);
    if (found == sizes.end()) fail<ConfigError>("no estimate of the memory that ", name, " needs");
    return *found;
}

NetworkSize backbone_size(std::string_view name) {
    static constexpr std::array<NetworkSize, 4> sizes{{{"small_conv", 100'000, 500'000, 64},
                                                       {"mobilefacenet", 1'000'000, 8'000'000, 128},
                                                       {"iresnet50", 43'600'000, 27'000'000},
                                                       {"iresnet100", 65'200'000, 50'000'000}}};
    return size_of(sizes, name);
}

/// `saved`: for each pixel, all that is alive at the peak of the backward pass.
NetworkSize perceptual_size(std::string_view name) {
    static constexpr std::array<NetworkSize, 3> sizes{
        {{"vgg16", 14'700'000, 800}, {"alexnet", 2'500'000, 60}, {"squeezenet1_1", 700'000, 150}}};
    return size_of(sizes, name);
}

/// What a network with these layers keeps and what it needs for a moment, in numbers.
struct Need {
    std::int64_t saved = 0;
    std::int64_t passing = 0;

    void add(const Need& other) {
        saved += other.saved;
        passing = std::max(passing, other.passing);
    }
};

std::int64_t decoder_weights(const DecoderConfig& config) {
    constexpr std::int64_t geometry = 179, appearance = 127;
    const std::int64_t width = config.field_width, encoding = 3 + 6 * config.frequencies;
    if (config.conditioning == "concatenation") {
        std::int64_t weights = (config.field_layers + 2) * width * (width + 1) + 2 * (encoding + geometry) * width +
                               width / 2 * (appearance + config.feature_channels);
        std::int64_t in = config.feature_channels;
        for (const std::int64_t out : config.render == "none" ? std::vector<std::int64_t>{} : config.block_channels) {
            weights += 10 * in * in + in * out;
            in = out;
        }
        return weights;
    }
    std::int64_t weights = (config.field_layers + 1) * width * (width + geometry + 2) + 2 * encoding * (width + geometry) +
                           width * config.feature_channels;
    for (const std::int64_t size : code_sizes) weights += config.mapping_layers * size * (size + 1);
    std::int64_t in = config.feature_channels;
    for (const std::int64_t out : config.block_channels) {
        weights += 4 * in * in + in * (out + appearance) + out * (out + appearance);
        in = out;
    }
    return weights;
}

/// Field and compositing: samples, results and their gradients, and the arguments of the sines.
Need field_need(const DecoderConfig& config, const TrainingPhase& phase, bool recomputed) {
    const bool blocks = config.render == "blocks";
    const std::int64_t rays = phase.micro_batch * square(blocks ? config.rays.rays_per_side : phase.resolution);
    const std::int64_t encoding = 3 + 6 * config.frequencies;
    if (config.conditioning == "concatenation") {
        // Points, distances, depths and weights of all rays with their gradients; the layers of one tile of samples, and the sums
        // of its weights' gradients.
        constexpr std::int64_t tile = 2048;
        const std::int64_t composited = blocks ? config.field_width / 2 : 3;
        const std::int64_t layers = (config.field_layers + 4) * config.field_width;
        return {rays * (2 * (composited + phase.samples_per_ray) + 8 * phase.samples_per_ray),
                tile * layers + 4 * config.field_width * layers};
    }
    const std::int64_t weights = config.field_width * (config.field_width * (config.field_layers + 1) + 2 * encoding);
    const std::int64_t arguments = recomputed ? 0 : rays * phase.samples_per_ray * config.field_width * (config.field_layers + 1);
    return {rays * (3 * (config.field_width + phase.samples_per_ray) + 5 * phase.samples_per_ray) + arguments,
            field_sums * weights};
}

/// A render block of this side: upsampled input, detail of the upsampler, and between the two modulated layers.
Need block_need(std::int64_t side, std::int64_t in, std::int64_t out, std::int64_t images, bool recomputed) {
    const std::int64_t pixels = square(side);
    const std::int64_t features = pixels * out;
    const std::int64_t between = pixels * (2 * in + out);
    const std::int64_t largest = pixels * std::max(in, out);
    // The picture in this block's colours, and what the loss keeps of it.
    const std::int64_t colours = 5 * 3 * pixels;
    if (recomputed) return {images * (features + colours), between + 4 * largest + 3 * images * features / 2};
    return {images * (features + between + colours), 3 * images * largest};
}

Need decoder_need(const DecoderConfig& config, const TrainingPhase& phase, const Recomputation& recomputation, bool mask) {
    Need need = field_need(config, phase, recomputation.field);
    if (config.render == "none") {
        need.add({phase.micro_batch * 5 * 4 * square(phase.resolution), 0});
        return need;
    }
    std::int64_t in = config.feature_channels;
    std::int64_t side = config.rays.rays_per_side;
    std::int64_t mask_numbers = 0;
    for (const std::int64_t out : config.block_channels) {
        side *= 2;
        if (side > phase.resolution) break;
        need.add(block_need(side, in, out, phase.micro_batch, recomputation.blocks));
        mask_numbers += phase.micro_batch * config.mask_channels * square(side);
        in = out;
    }
    if (mask) {
        const std::int64_t last = phase.micro_batch * config.mask_channels * square(phase.resolution);
        const std::int64_t passing = 3 * last + phase.micro_batch * in * square(phase.resolution);
        if (recomputation.blocks) {
            need.add({0, mask_numbers + last + passing});
        } else {
            need.add({mask_numbers + last, passing});
        }
    }
    return need;
}

std::int64_t discriminator_channels(const DiscriminatorConfig& config, std::int64_t side) {
    const double full = side < 64 ? 512.0 : config.channel_multiplier * 16384.0 / static_cast<double>(side);
    return std::clamp<std::int64_t>(std::llround(full), 1, config.max_channels);
}

std::int64_t discriminator_weights(const DiscriminatorConfig& config, std::int64_t resolution) {
    const std::int64_t top = discriminator_channels(config, 4);
    std::int64_t weights = 9 * top * top + 16 * top * top;
    for (std::int64_t side = 8; side <= resolution; side *= 2) {
        const std::int64_t in = discriminator_channels(config, side), out = discriminator_channels(config, side / 2);
        weights += 9 * in * in + 10 * in * out + 3 * in;
    }
    return weights;
}

/// Each block keeps the inputs of its two convolutions, the blurred one twice, and of its skip.
Need discriminator_need(const DiscriminatorConfig& config, const TrainingPhase& phase) {
    Need need;
    for (std::int64_t side = 8; side <= phase.resolution; side *= 2) {
        const std::int64_t in = discriminator_channels(config, side) * square(side);
        const std::int64_t out = discriminator_channels(config, side / 2) * square(side / 2);
        need.add({phase.micro_batch * (13 * in / 4 + out), phase.micro_batch * 4 * in});
    }
    return need;
}

bool has_discriminator(const TrainConfig& config, const TrainingPhase& phase) {
    return phase.stage == 2 && config.loss.adversarial_weight > 0.0;
}

std::int64_t encoder_weights(const EncoderConfig& config) {
    const NetworkSize backbone = backbone_size(config.backbone);
    const std::int64_t width = config.head_width;
    return backbone.weights + 4 * (backbone.embedding * width + width * width / 2) + width / 2 * code_size;
}

/// Weights; of those that are trained gradient, mean gradient and both moments; averages of all.
std::int64_t lasting_numbers(const TrainConfig& config, const TrainingPhase& phase) {
    const std::int64_t encoder = config.model.code_source == "encoder" ? encoder_weights(config.model.encoder) : 0;
    const std::int64_t decoder = decoder_weights(config.model.decoder);
    const double half_life = phase.stage == 1 ? config.stage1.average_half_life : config.stage2.average_half_life;
    std::int64_t numbers = encoder + decoder + (half_life > 0.0 ? encoder + decoder : 0);
    numbers += 4 * (phase.stage == 1 ? encoder + decoder : decoder);
    if (config.model.reconstruction.perceptual_weight > 0.0)
        numbers += perceptual_size(config.model.reconstruction.perceptual.network).weights;
    if (!has_discriminator(config, phase)) return numbers;
    // Three more for the state that a failed step goes back to.
    return numbers + 8 * discriminator_weights(config.discriminator, config.model.decoder.resolution);
}

std::int64_t generator_numbers(const TrainConfig& config, const TrainingPhase& phase, const Recomputation& recomputation) {
    const ModelConfig& model = config.model;
    // The photos at full size, as the encoder and as the losses see them, with their masks.
    const std::int64_t photos = phase.micro_batch * 10 * square(model.decoder.resolution);
    const bool mask = config.loss.mask_weight > 0.0 && phase.resolution == model.decoder.resolution;
    Need need{photos, 0};
    need.add(decoder_need(model.decoder, phase, recomputation, mask));
    const std::int64_t encoder = phase.micro_batch * backbone_size(model.encoder.backbone).saved;
    if (phase.stage == 1 && model.code_source == "encoder") need.saved += encoder;
    const ReconstructionConfig& loss = model.reconstruction;
    if (loss.perceptual_weight > 0.0) {
        const std::int64_t limit = loss.perceptual_resolution;
        const std::int64_t side = limit > 0 ? std::min(limit, phase.resolution) : phase.resolution;
        need.add({0, perceptual_size(loss.perceptual.network).saved * square(side)});
    }
    if (has_discriminator(config, phase)) {
        const Need judge = discriminator_need(config.discriminator, phase);
        // A frozen layer keeps no input, only what its activation needs.
        need.add({0, judge.saved / 2 + judge.passing});
    }
    return need.saved + need.passing;
}

/// The budget that an estimate needs, in GiB.
double budget_for(const TrainConfig& config, const TrainingPhase& phase, const Recomputation& recomputation) {
    return estimate_margin * static_cast<double>(estimate_step_memory(config, phase, recomputation).peak()) / gibibyte;
}

}  // namespace

std::int64_t StepMemory::peak() const {
    return lasting + std::max({generator, discriminator, regularizer});
}

StepMemory estimate_step_memory(const TrainConfig& config, const TrainingPhase& phase, const Recomputation& recomputation) {
    const auto heap_bytes = [](std::int64_t numbers) {
        return static_cast<std::int64_t>(heap_factor * static_cast<double>(bytes_per_number * numbers));
    };
    StepMemory memory;
    memory.lasting = program_bytes + bytes_per_number * lasting_numbers(config, phase);
    memory.generator = heap_bytes(generator_numbers(config, phase, recomputation));
    if (has_discriminator(config, phase)) {
        const Need judge = discriminator_need(config.discriminator, phase);
        memory.discriminator = heap_bytes(judge.saved + judge.passing);
        memory.regularizer = heap_bytes(9 * judge.saved / 4 + judge.passing);
    }
    return memory;
}

Recomputation choose_recomputation(const TrainConfig& config, const TrainingPhase& phase) {
    const double budget = config.memory.budget_gibibytes;
    const auto fits = [&](const Recomputation& recomputation) {
        return budget == 0.0 || budget_for(config, phase, recomputation) <= budget;
    };
    for (const Recomputation& recomputation : {Recomputation{}, Recomputation{.blocks = true}})
        if (fits(recomputation)) return recomputation;
    const Recomputation most{.blocks = true, .field = true};
    if (fits(most)) return most;
    const double smallest = std::ceil(budget_for(config, phase, most) * 10.0) / 10.0;
    fail<ConfigError>("memory.budget_gibibytes = ", budget, " is too little for stage ", phase.stage, " at ", phase.resolution,
                      " pixels with ", phase.micro_batch, " images at once; it needs ", smallest, " or a smaller micro_batch");
}

}  // namespace stymo
