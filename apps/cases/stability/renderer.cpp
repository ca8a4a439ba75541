#include <cmath>

#include "apps/cases/stability/case.h"
#include "core/ops/ops.h"
#include "core/rng.h"
#include "nn/realtime/face_renderer.h"

namespace stymo::stability {

namespace {

constexpr std::int64_t samples = 16;

/// A head-sized field with fixed weights, on 256 rays.
ModelConfig small_config() {
    ModelConfig config;
    config.decoder.resolution = 32;
    config.decoder.rays.rays_per_side = 16;
    config.decoder.field_width = 16;
    config.decoder.field_layers = 2;
    config.decoder.feature_channels = 8;
    config.decoder.frequencies = 2;
    config.decoder.block_channels = {8};
    config.decoder.mask_channels = 2;
    config.decoder.mapping_layers = 1;
    config.encoder.backbone = "small_conv";
    config.encoder.head_width = 8;
    config.reconstruction.resolution_weights = {1.0};
    config.reconstruction.perceptual_weight = 0.0;
    return config;
}

void set_density(Model& model, const Tensor& weight, double bias) {
    for (const Parameter& parameter : model.parameters().all()) {
        if (parameter.name() == "decoder.field.density.weight") parameter.set_value(weight);
        if (parameter.name() == "decoder.field.density.bias")
            parameter.set_value(Tensor::full({1}, bias));
    }
}

/// Density softplus(slope (h - level) - 1) of one channel h of the last sine layer: a surface where
/// h passes the level, and a shell about the maximum of h where the level is close to 1.
Model with_density(double slope, double level) {
    Rng rng(21);
    Model model(small_config(), rng);
    const std::int64_t width = model.config().decoder.field_width;
    Tensor weight = Tensor::zeros({1, width});
    weight.mutable_values<float>()[0] =
        static_cast<float>(slope * std::sqrt(static_cast<double>(width)));
    set_density(model, weight, -slope * level);
    return model;
}

/// The image in float32 by a mode of the renderer, in float64 by the decoder that training uses.
StabilityCase rendered(const std::string& name, const std::string& behaviour, double bound,
                       double slope, double level, RenderMode mode, double zoom = 1.0) {
    return {
        .name = name + ", mode " + name_of(mode),
        .behaviour = behaviour,
        .value_bound = bound,
        .run = [=](DType dtype) {
            // The decoder has no bound sideways, so far cameras are compared with exact frames.
            const bool by_decoder = dtype == DType::float64 && zoom == 1.0;
            Model model = with_density(slope, level);
            const CameraConfig& of = model.config().camera;
            const Camera camera = camera_from_pose(
                pivot_pose(0.3, 0.1, 0.0, zoom * of.distance, of.pivot_depth), of.intrinsics);
            Rng rng(22);
            Codes codes;
            for (std::size_t group = 0; group < code_sizes.size(); ++group)
                codes.groups[group] = rng.normal({1, code_sizes[group]}, 0.0, 1.0)
                                          .to(by_decoder ? dtype : DType::float32);
            if (by_decoder) {
                model.parameters().convert(dtype);
                return StabilityResult{
                    .values = {
                        decoded_view(model, codes, 0, camera, {.samples_per_ray = samples}).image}};
            }
            FaceRenderer renderer(model,
                                  {.mode = dtype == DType::float64 ? RenderMode::exact : mode,
                                   .samples_per_ray = samples,
                                   .tolerance = 0.01});
            renderer.show(codes);
            return StabilityResult{.values = {renderer.render(camera).image}};
        }};
}

}  // namespace

std::vector<StabilityCase> renderer_cases() {
    std::vector<StabilityCase> rows;
    for (const RenderMode mode : {RenderMode::exact, RenderMode::skip}) {
        const bool exact = mode == RenderMode::exact;
        const std::string sampled =
            exact ? "every sample" : "samples are left out where the grid has no density";
        rows.push_back(rendered("surface that is sharper than a sample's interval", sampled,
                                exact ? 1e-4 : 1e-3, 1e3, 0.0, mode));
        rows.push_back(rendered("surface of densities up to 1e6", sampled, exact ? 1e-4 : 1e-3, 1e6,
                                0.0, mode));
        rows.push_back(rendered("shell that is thinner than a sample's interval", sampled,
                                exact ? 1e-4 : 1e-3, 1e5, 0.999, mode));
    }
    rows.push_back(rendered("camera at three times the distance",
                            "what is left out is what exact frames do not show", 1e-3, 3.0, 0.0,
                            RenderMode::skip, 3.0));
    return rows;
}

}  // namespace stymo::stability
