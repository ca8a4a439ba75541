#include "apps/common/lpips_options.h"

namespace stymo {

namespace {

std::string network_called(const std::string& metric) {
    if (metric == "squeeze") return "squeezenet1_1";
    if (metric == "alex") return "alexnet";
    return metric;
}

LpipsConfig with_files(LpipsConfig config, const LpipsOptions& options) {
    if (!options.trunk.empty()) config.trunk = options.trunk;
    if (!options.heads.empty()) config.heads = options.heads;
    return config;
}

}  // namespace

void declare_lpips_metric(Command& command, LpipsOptions& options) {
    command.option("--lpips", options.metric, "also measure LPIPS, with this network")
        .one_of({"squeeze", "vgg16", "alex"});
}

void declare_lpips_files(Command& command, LpipsOptions& options) {
    command.option("--lpips-trunk", options.trunk,
                   "weights of the network of LPIPS, written by stymo-weights import; random: "
                   "untrained weights");
    command.option("--lpips-heads", options.heads,
                   "linear heads of LPIPS, written by stymo-weights import; random: all ones");
}

void declare_perceptual_weight(Command& command, LpipsOptions& options) {
    command
        .option("--perceptual-network", options.perceptual_network,
                "network that compares images while fitting: one of LPIPS, or the model's own "
                "encoder, which needs no weight files (default: the model's setting)")
        .one_of({"encoder", "squeeze", "vgg16", "alex"});
    command
        .option("--perceptual-weight", options.perceptual_weight,
                "weight of LPIPS while fitting, 0: no LPIPS (default: the model's setting)")
        .range(0, 1e6);
    command
        .option("--perceptual-resolution", options.perceptual_resolution,
                "largest side of the images that LPIPS compares while fitting, 0: no limit "
                "(default: the model's setting)")
        .range(0, 4096);
}

LpipsConfig metric_config(const LpipsOptions& options, const LpipsConfig& model) {
    const std::string own =
        model.network == encoder_network ? network_called("squeeze") : model.network;
    const std::string network = options.metric.empty() ? own : network_called(options.metric);
    return with_files(network == model.network ? model : LpipsConfig{.network = network}, options);
}

ReconstructionConfig fitting_config(const LpipsOptions& options, ReconstructionConfig model) {
    if (options.perceptual_weight) model.perceptual_weight = *options.perceptual_weight;
    if (options.perceptual_resolution) model.perceptual_resolution = *options.perceptual_resolution;
    const std::string network = network_called(options.perceptual_network);
    if (!network.empty() && network != model.perceptual.network)
        model.perceptual = {.network = network};
    const LpipsConfig metric = metric_config(options, model.perceptual);
    if (metric.network == model.perceptual.network) model.perceptual = metric;
    return model;
}

}  // namespace stymo
