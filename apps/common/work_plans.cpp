#include "apps/common/work_plans.h"

#include <algorithm>
#include <sstream>

namespace stymo {

namespace {

std::string numbers_text(const Model& model, const std::string& prefix) {
    return std::to_string(model.parameters().element_count(prefix)) + " numbers";
}

PlannedPart encoder_part(const Model& model) {
    return {"encoder", model.has_encoder(), model.has_encoder() ? numbers_text(model, "encoder.") : "the codes are given"};
}

PlannedPart lpips_part(const Lpips* lpips, const std::string& without) {
    return {"LPIPS", lpips != nullptr, lpips != nullptr ? lpips->label() : without};
}

PlannedPart discriminator_part() {
    return {"discriminator", false, "only the second stage of training has one"};
}

std::int64_t blocks_up_to(const DecoderConfig& decoder, std::int64_t resolution) {
    std::int64_t count = 0;
    for (std::int64_t side = decoder.rays.rays_per_side; side < resolution; side *= 2) ++count;
    return count;
}

/// A term with its weight, or the key that turns it on.
PlannedPart term(const std::string& name, double weight, const std::string& key) {
    std::ostringstream text;
    text << (weight > 0.0 ? "weight " : key + " is ") << weight;
    return {name, weight > 0.0, text.str()};
}

/// Terms that training and fitting have in common.
std::vector<PlannedPart> reconstruction_terms(const ReconstructionConfig& config, const Lpips* lpips) {
    return {term("photometric loss", config.photometric_weight, "reconstruction.photometric_weight"),
            term("perceptual loss", lpips == nullptr ? 0.0 : config.perceptual_weight, "its weight")};
}

bool has_second_stage(const Trainer& trainer) {
    return std::ranges::any_of(trainer.schedule().phases(), [](const TrainingPhase& phase) { return phase.stage == 2; });
}

PlannedPart planned_discriminator(const TrainConfig& config, const Trainer& trainer) {
    if (!has_second_stage(trainer)) return {"discriminator", false, "there is no second stage"};
    const bool used = config.loss.adversarial_weight > 0.0;
    return {"discriminator", used, used ? "made when the second stage begins" : "loss.adversarial_weight is 0"};
}

PlannedPart averaged_model(const TrainConfig& config, const Trainer& trainer) {
    const bool used =
        config.stage1.average_half_life > 0.0 || (has_second_stage(trainer) && config.stage2.average_half_life > 0.0);
    return {"averaged model", used, used ? "" : "average_half_life is 0"};
}

}  // namespace

WorkPlan render_plan(const Model& model, const RendererOptions& options) {
    const DecoderConfig& decoder = model.config().decoder;
    const std::int64_t side = options.resolution == 0 ? decoder.resolution : options.resolution;
    const bool lattice = options.mode == RenderMode::skip || options.mode == RenderMode::bf16;
    const bool baked = options.mode == RenderMode::baked;
    std::ostringstream blocks;
    blocks << blocks_up_to(decoder, side) << " of " << blocks_up_to(decoder, decoder.resolution) << ", up to " << side
           << " pixels";
    WorkPlan plan;
    plan.modules = {encoder_part(model),
                    {"radiance field", true, numbers_text(model, "decoder.field.")},
                    {"render blocks", true, blocks.str()},
                    {"mask branch of the renderer", options.mask, options.mask ? "" : "without --mask"},
                    {"density lattice", lattice, lattice ? "" : (baked ? "a bake needs none" : "every sample is taken")},
                    {"baked samples", baked, baked ? "" : "only --mode baked reads them"},
                    lpips_part(nullptr, "rendering compares nothing"),
                    discriminator_part()};
    plan.computed = {{"depth", options.depth, options.depth ? "" : "without --depth"},
                     {"gradients", false, "the model is frozen: nothing is recorded"}};
    return plan;
}

WorkPlan fit_plan(const Model& model, const ReconstructionConfig& config, const ReconstructionLoss& loss, const Lpips* metric,
                  const FitOptions& options) {
    const Lpips* made = loss.lpips() != nullptr ? loss.lpips() : metric;
    WorkPlan plan;
    plan.modules = {encoder_part(model),
                    {"decoder", true, numbers_text(model, "decoder.")},
                    lpips_part(made, "the perceptual weight is 0 and no metric was asked for"),
                    discriminator_part()};
    const double regularizer = options.regularizer < 0.0 ? model.config().reconstruction.fit_regularizer : options.regularizer;
    plan.computed = reconstruction_terms(config, loss.lpips());
    plan.computed.push_back(term("length of the offsets", regularizer, "--regularizer"));
    plan.computed.push_back({"mask branch while fitting", false, "no loss of a fit reads the mask"});
    plan.computed.push_back({"samples below the tolerance", options.tolerance <= 0.0,
                             options.tolerance <= 0.0 ? "--tolerance is 0" : "left out between two examinations"});
    plan.computed.push_back({"large pictures in the first steps", options.coarse_steps == 0,
                             options.coarse_steps == 0 ? "" : std::to_string(options.coarse_steps) + " steps do without"});
    const bool curvature = options.optimizer == FitOptimizer::lbfgs;
    plan.computed.push_back({"curvature", curvature, curvature ? "L-BFGS" : "--optimizer is adam"});
    plan.computed.push_back({"gradients of the codes", options.steps > 0, std::to_string(code_size) + " numbers in 4 tensors"});
    plan.computed.push_back({"gradients of the pose", options.refine_pose, options.refine_pose ? "" : "without --refine-pose"});
    plan.computed.push_back({"gradients of the weights", false, "the model is frozen"});
    return plan;
}

WorkPlan train_plan(const TrainConfig& config, const Trainer& trainer) {
    const Lpips* lpips = trainer.reconstruction().lpips();
    const Model& model = trainer.model();
    WorkPlan plan;
    plan.modules = {encoder_part(model),
                    {"decoder", true, numbers_text(model, "decoder.")},
                    lpips_part(lpips, "reconstruction.perceptual_weight is 0"),
                    planned_discriminator(config, trainer),
                    averaged_model(config, trainer)};
    const LossConfig& weights = config.loss;
    const double adversarial = has_second_stage(trainer) ? weights.adversarial_weight : 0.0;
    plan.computed = reconstruction_terms(config.model.reconstruction, lpips);
    plan.computed.push_back({"code loss", true, "for images whose codes the data set has"});
    plan.computed.push_back(term("mask loss", weights.mask_weight, "loss.mask_weight"));
    plan.computed.push_back(term("opacity loss", weights.opacity_weight, "loss.opacity_weight"));
    plan.computed.push_back(term("variance of the depth", weights.depth_variance_weight, "loss.depth_variance_weight"));
    plan.computed.push_back(term("length of the codes", weights.code_norm_weight, "loss.code_norm_weight"));
    plan.computed.push_back(term("adversarial loss", adversarial, "its weight, or that of a second stage,"));
    plan.computed.push_back({"gradients of the weights", true, "of all that take part at a step's resolution"});
    return plan;
}

void add_counts(Explainer& explainer, const RenderCounts& counts) {
    explainer.count("samples_of_the_last_frame", counts.samples);
    explainer.count("through_the_field", counts.field_samples);
    explainer.count("tiles", counts.tiles);
    explainer.count("pixels", counts.pixels);
    explainer.count("pixels_computed", counts.pixels_computed);
    explainer.count("layers", counts.layers);
    explainer.count("layers_computed", counts.layers_computed);
    explainer.count("foldings_of_weights", counts.folds);
}

}  // namespace stymo
