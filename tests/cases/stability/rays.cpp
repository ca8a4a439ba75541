#include <cmath>
#include <limits>

#include "cases/stability/case.h"
#include "core/ops/ops.h"
#include "core/rng.h"
#include "nn/losses.h"
#include "nn/models/radiance_field.h"
#include "nn/realtime/face_renderer.h"
#include "render/composite.h"
#include "support/tiny_model.h"

namespace stymo::stability {

namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();
constexpr std::int64_t samples = 16;

Tensor along_ray(double begin, double step, std::int64_t count, DType dtype) {
    std::vector<float> values;
    for (std::int64_t i = 0; i < count; ++i)
        values.push_back(static_cast<float>(begin + step * static_cast<double>(i)));
    return Tensor::from({1, 1, count}, values).to(dtype);
}

/// Weights, transmittance and depth of one ray whose density is the first input, with intervals of
/// this length.
Function composited(double delta) {
    return [delta](const std::vector<Variable>& inputs) {
        const Variable& density = inputs.front();
        const std::int64_t count = density.shape(2);
        const CompositeWeights result = composite_weights(
            density, Tensor::full({1, 1, count}, static_cast<float>(delta)).to(density.dtype()));
        const Tensor depths = along_ray(2.5, 0.25, count, density.dtype());
        return std::vector<Variable>{result.weights, result.transmittance,
                                     composite_depth(result, depths, 9.0),
                                     depth_variance(result.weights, depths)};
    };
}

StabilityCase uniform_density(const std::string& name, double density,
                              const std::string& behaviour) {
    return row(name, behaviour, 1e-6, 1e-6, {Tensor::full({1, 1, samples}, density)},
               composited(0.25));
}

/// A small field with fixed weights on one ray; the style is the first input.
StabilityResult field_rays(DType dtype, const Tensor& style, const Tensor& deltas,
                           double points_scale) {
    ParameterStore store;
    Rng rng(5);
    const RadianceField field(
        {.frequencies = 4, .width = 16, .layers = 4, .feature_channels = 8, .style_size = 6}, store,
        "field", rng);
    store.convert(dtype);
    const std::int64_t count = deltas.shape(2);
    const Tensor points = Rng(6).uniform({1, count, 3}, -points_scale, points_scale).to(dtype);
    return differentiate(dtype, {style}, [&](const std::vector<Variable>& inputs) {
        const RenderedRays rays =
            field.render({.points = points, .deltas = deltas.to(dtype)}, inputs.front());
        return std::vector<Variable>{rays.weights.weights, rays.weights.transmittance,
                                     rays.composited};
    });
}

std::vector<StabilityCase> density_cases() {
    const std::string product =
        "weight (t_i + t_(i+1)) tanh(sigma delta / 2) instead of the difference t_i - t_(i+1)";
    const std::string opaque =
        "transmittance underflows to 0: the first sample takes the whole weight, gradient 0";
    std::vector<StabilityCase> rows;
    rows.push_back(uniform_density("density 0", 0.0, "weights 0, transmittance 1, gradient delta"));
    rows.push_back(uniform_density("density 1e-30", 1e-30, product));
    rows.push_back(uniform_density("density 1e-3 (thin fog)", 1e-3, product));
    rows.push_back(uniform_density("density 60, optical depth 15 of an interval", 60.0,
                                   "tanh' from its argument: 1 - tanh^2 has no digits left here"));
    rows.push_back(uniform_density("density 1e8", 1e8, opaque));
    rows.push_back(uniform_density("density 1e30", 1e30, opaque));
    rows.push_back(uniform_density("density infinite", infinity, "clamped to 1e30, gradient 0"));
    Tensor mixed = Rng(2).uniform({1, 1, samples}, 0.0, 4.0);
    mixed.mutable_values<float>()[3] = 0.0F;
    mixed.mutable_values<float>()[5] = 1e-30F;
    mixed.mutable_values<float>()[9] = 1e8F;
    rows.push_back(row("densities 0, 1e-30, 1e8 on one ray", "what lies behind the wall weighs 0",
                       1e-6, 1e-6, {mixed}, composited(0.25)));
    return rows;
}

std::vector<StabilityCase> interval_cases() {
    const Tensor density = Rng(3).uniform({1, 1, samples}, 0.0, 4.0);
    std::vector<StabilityCase> rows;
    rows.push_back(row("intervals of length 0", "weights 0, transmittance 1, gradient 0", 1e-6,
                       1e-6, {density}, composited(0.0)));
    rows.push_back(row("intervals of length 1e-12", "optical depths keep their relative precision",
                       1e-6, 1e-6, {density}, composited(1e-12)));
    rows.push_back(row("infinite density in intervals of length 0",
                       "density clamped to 1e30: 0, not infinity times 0", 1e-6, 1e-6,
                       {Tensor::full({1, 1, samples}, infinity)}, composited(0.0)));
    rows.push_back(row("cumulative sum of 4096 optical depths", "running sum in float64", 1e-6,
                       1e-6, {Rng(4).uniform({1, 1, 4096}, 0.0, 2e-3)}, composited(1.0)));
    rows.push_back(row("cumulative sum of 4096 equal numbers 0.1", "running sum in float64", 1e-6,
                       1e-6, {Tensor::full({1, 4096}, 0.1)},
                       each([](const Variable& x) { return cumsum(x, 1); })));
    rows.push_back(refused<ValueError>(
        "samples in reverse order", "refused: a negative interval would let a ray gain light",
        "deltas", [=](DType dtype) { return differentiate(dtype, {density}, composited(-0.25)); }));
    Tensor deltas = Tensor::full({1, 1, samples}, 0.1);
    deltas.mutable_values<float>()[7] = -0.1F;
    const Tensor style = Rng(7).normal({1, 6}, 0.0, 1.0);
    rows.push_back(
        refused<ValueError>("one sample of the fused field in reverse order", "refused", "deltas",
                            [=](DType dtype) { return field_rays(dtype, style, deltas, 1.0); }));
    deltas.mutable_values<float>()[7] = std::numeric_limits<float>::quiet_NaN();
    rows.push_back(
        refused<ValueError>("an interval that is not a number", "refused", "deltas",
                            [=](DType dtype) { return field_rays(dtype, style, deltas, 1.0); }));
    return rows;
}

std::vector<StabilityCase> field_cases() {
    const Tensor deltas = Tensor::full({1, 1, samples}, 0.1),
                 style = Rng(7).normal({1, 6}, 0.0, 1.0);
    std::vector<StabilityCase> rows;
    const auto add = [&](std::string name, std::string behaviour, double bound,
                         double gradient_bound, const Tensor& of, double scale) {
        rows.push_back({.name = std::move(name),
                        .behaviour = std::move(behaviour),
                        .value_bound = bound,
                        .gradient_bound = gradient_bound,
                        .run = [=](DType dtype) { return field_rays(dtype, of, deltas, scale); }});
    };
    add("fused field on ordinary rays", "one kernel for field and compositing", 1e-5, 1e-4, style,
        1.0);
    add("fused field at points 1e4 away",
        "sines of large arguments by the library's reduction; weights still sum to 1", 1e-2, 1e-1,
        style, 1e4);
    for (const double length : {1e3, 1e6}) {
        Tensor longer = style;
        for (float& value : longer.mutable_values<float>()) value *= static_cast<float>(length);
        add("fused field, style of length " + std::string(length > 1e4 ? "1e6" : "1e3"),
            "demodulation takes the length out again", 1e-4, 1e-3, longer, 1.0);
    }
    return rows;
}

}  // namespace

std::vector<StabilityCase> ray_cases() {
    return joined({density_cases(), interval_cases(), field_cases()});
}

namespace {

/// A head-sized field with fixed weights, on 256 rays.
ModelConfig small_config() {
    ModelConfig config = test::tiny_model_config();
    config.decoder.resolution = 32;
    config.decoder.rays.rays_per_side = 16;
    config.decoder.field_width = 16;
    config.decoder.block_channels = {8};
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
