#include "nn/pretrained/perceptual/lpips.h"

#include <algorithm>
#include <array>

#include "core/error.h"
#include "core/io/tensor_file.h"
#include "core/ops/ops.h"
#include "nn/pretrained/perceptual/trunk.h"

namespace stymo {
namespace {

constexpr const char* random_weights = "random";
constexpr const char* trunk_prefix = "lpips.trunk.";
constexpr const char* heads_prefix = "lpips.heads.";

const TrunkDescription& description_of(const std::string& network) {
    const std::vector<TrunkDescription>& all = trunk_descriptions();
    const auto found = std::ranges::find(all, network, &TrunkDescription::name);
    if (found != all.end()) return *found;
    std::string known;
    for (const TrunkDescription& one : all) known += (known.empty() ? "" : ", ") + one.name;
    fail<ConfigError>("LPIPS: no network is called \"", network, "\"; choose one of ", known);
}

/// Describes what a user can do about a missing file.
std::string ways_out(const std::string& part, const std::string& off_switch) {
    // Who turns it off by a key configures a training, which has no such option.
    const bool has_option = !off_switch.starts_with("reconstruction.");
    return "reconstruction.perceptual_" + part + (has_option ? " or --lpips-" + part : "") +
           ", or do without LPIPS: " + off_switch;
}

/// `published`: the name of the published file, `imported`: its name after the import.
void require_given(const std::string& path, const std::string& part, const std::string& network,
                   const std::string& published, const std::string& source,
                   const std::string& imported, const std::string& off_switch) {
    if (!path.empty()) return;
    fail<ConfigError>("LPIPS (", network, "): no ", part, "; get ", published, " (", source,
                      "), import it with `stymo-weights import ", published, ' ', imported,
                      "` and name the result in ", ways_out(part, off_switch));
}

TensorFile read_weights(const std::string& path, const std::string& part,
                        const std::string& off_switch) {
    if (!std::filesystem::exists(path))
        fail<FileError>("LPIPS ", part, ": no file ", path, "; name another one in ",
                        ways_out(part, off_switch));
    return read_tensor_file(path);
}

/// torchvision's names and layout: convolutions are (out, in, height, width).
void load_trunk(const ParameterStore& store, const TensorFile& file, const std::string& source,
                const std::string& network) {
    for (const Parameter& parameter : store.all()) {
        if (!parameter.name().starts_with(trunk_prefix)) continue;
        const std::string name = parameter.name().substr(std::string(trunk_prefix).size());
        const auto found = file.tensors.find(name);
        if (found == file.tensors.end())
            fail<FileError>(source, ": no tensor ", name, "; this is not torchvision's ", network);
        Tensor value = found->second;
        if (value.rank() == 4) value = permute(value, {0, 2, 3, 1}).value();
        if (!(value.shape() == parameter.variable().shape()))
            fail<FileError>(source, ": ", name, " has shape ", found->second.shape(),
                            "; this is not torchvision's ", network);
        parameter.set_value(value.to(parameter.variable().dtype()));
    }
}

std::vector<Tensor> heads_of(const TensorFile& file, const std::string& source,
                             const TrunkDescription& description) {
    const std::string& prefix = description.heads_name;
    std::vector<Tensor> heads;
    for (const std::int64_t channels : tap_channels(description)) {
        const std::string name = "lin" + std::to_string(heads.size()) + ".model.1.weight";
        auto found = file.tensors.find(prefix + "." + name);
        if (found == file.tensors.end()) found = file.tensors.find(name);
        if (found == file.tensors.end())
            fail<FileError>(source, ": no tensor ", name, " or ", prefix, ".", name,
                            "; these are not LPIPS' heads");
        if (found->second.size() != channels)
            fail<FileError>(source, ": ", found->first, " has shape ", found->second.shape(),
                            " where ", channels,
                            " numbers are needed; these heads are not those of ", prefix);
        heads.push_back(found->second.reshaped({1, 1, 1, channels}).to(DType::float32));
    }
    return heads;
}

Variable as_the_network_expects(const Variable& images) {
    constexpr std::array<double, 3> shift{-0.030, -0.088, -0.188};
    constexpr std::array<double, 3> scale{0.458, 0.448, 0.450};
    return (images - Tensor::from({3}, shift).to(images.dtype())) /
           Tensor::from({3}, scale).to(images.dtype());
}

}  // namespace

std::vector<std::string> lpips_networks() {
    std::vector<std::string> names;
    for (const TrunkDescription& description : trunk_descriptions())
        names.push_back(description.name);
    return names;
}

std::vector<Tensor> read_lpips_heads(const std::filesystem::path& path,
                                     const std::string& network) {
    return heads_of(read_tensor_file(path), path.string(), description_of(network));
}

void describe(ConfigSchema& schema, LpipsConfig& config, const std::string& prefix) {
    std::vector<std::string> networks = lpips_networks();
    networks.emplace_back(encoder_network);
    schema.choice(prefix + "network", config.network, networks,
                  "network of LPIPS (paper: silent; its author uses VGG-16); encoder: the model's "
                  "own encoder instead of LPIPS, while fitting");
    schema.text(
        prefix + "trunk", config.trunk,
        ".safetensors file with torchvision's weights of that network; random: untrained weights");
    schema.text(prefix + "heads", config.heads,
                ".safetensors file with the linear heads of LPIPS v0.1; random: all ones");
}

struct Lpips::Implementation {
    LpipsConfig config;
    ParameterStore store;
    Trunk trunk;
    std::vector<Parameter> heads;

    Implementation(const LpipsConfig& settings, const TrunkDescription& description, Rng rng)
        : config(settings), trunk(description, store, trunk_prefix, rng) {
        const std::vector<std::int64_t> channels = tap_channels(description);
        for (std::size_t k = 0; k < channels.size(); ++k) {
            heads.push_back(store.create(heads_prefix + ("lin" + std::to_string(k)),
                                         Tensor::full({1, 1, 1, channels[k]}, 1.0)));
        }
        store.set_trainable("", false);
    }

    void set_heads(const std::vector<Tensor>& values) {
        for (std::size_t k = 0; k < heads.size(); ++k) heads[k].set_value(values[k]);
    }
};

Lpips::Lpips(const LpipsConfig& config, const std::string& off_switch) {
    const TrunkDescription& description = description_of(config.network);
    const std::string& network = config.network;
    require_given(config.trunk, "trunk", network, description.weights_file, "torchvision",
                  network + ".safetensors", off_switch);
    require_given(config.heads, "heads", network, description.heads_name + ".pth",
                  "PerceptualSimilarity, lpips/weights/v0.1",
                  "lpips_" + description.heads_name + ".safetensors", off_switch);
    TensorFile trunk;
    TensorFile heads;
    if (config.trunk != random_weights) trunk = read_weights(config.trunk, "trunk", off_switch);
    if (config.heads != random_weights) heads = read_weights(config.heads, "heads", off_switch);
    // "random" always means the same random weights.
    implementation_ =
        std::make_unique<Implementation>(config, description, Rng(0).split("lpips").split(network));
    if (config.trunk != random_weights)
        load_trunk(implementation_->store, trunk, config.trunk, network);
    if (config.heads != random_weights)
        implementation_->set_heads(heads_of(heads, config.heads, description));
}

Lpips::~Lpips() = default;
Lpips::Lpips(Lpips&&) noexcept = default;
Lpips& Lpips::operator=(Lpips&&) noexcept = default;

std::vector<Variable> Lpips::taps(const Variable& images) const {
    if (images.rank() != 4 || images.shape(3) != 3)
        fail<ShapeError>("LPIPS needs images (batch, height, width, 3), got ", images.shape());
    if (std::min(images.shape(1), images.shape(2)) < smallest_side())
        fail<ShapeError>("LPIPS with ", config().network, " needs images of at least ",
                         smallest_side(), " x ", smallest_side(), " pixels, got ", images.shape());
    return implementation_->trunk(as_the_network_expects(images));
}

Lpips::Features Lpips::features(const Variable& images) const {
    Features features;
    for (const Variable& tap : taps(images))
        features.push_back(unit_channels(tap, feature_epsilon));
    return features;
}

Variable Lpips::distance_to(const Variable& images, const Features& target) const {
    const std::vector<Variable> all = taps(images);
    if (target.size() != all.size())
        fail<ShapeError>("LPIPS with ", config().network, " compares ", all.size(),
                         " features, got ", target.size());
    Variable total;
    for (std::size_t k = 0; k < all.size(); ++k) {
        const Tensor head = implementation_->heads[k].variable().value();
        const Variable term =
            feature_distance(all[k], target[k].value(), head.reshaped({head.size()}));
        total = total.defined() ? total + term : term;
    }
    return total;
}

std::vector<Variable> Lpips::terms(const Features& a, const Features& b) const {
    const std::vector<Parameter>& heads = implementation_->heads;
    if (a.size() != heads.size() || b.size() != heads.size())
        fail<ShapeError>("LPIPS with ", config().network, " compares ", heads.size(),
                         " features, got ", a.size(), " and ", b.size());
    std::vector<Variable> terms;
    for (std::size_t k = 0; k < heads.size(); ++k) {
        terms.push_back(
            reshape(sum(mean_squared_difference(a[k], b[k]) * heads[k].variable(), {3}), {-1}));
    }
    return terms;
}

Variable Lpips::distance(const Features& a, const Features& b) const {
    const std::vector<Variable> all = terms(a, b);
    Variable total = all.front();
    for (std::size_t k = 1; k < all.size(); ++k) total = total + all[k];
    return total;
}

std::int64_t Lpips::smallest_side() const {
    return implementation_->trunk.smallest_side();
}

LayerMemory Lpips::memory(std::int64_t side) const {
    return {0, description_of(config().network).alive_per_pixel * side * side};
}

std::int64_t Lpips::element_count() const {
    return implementation_->store.element_count();
}

const LpipsConfig& Lpips::config() const {
    return implementation_->config;
}

bool Lpips::random() const {
    return config().trunk == random_weights || config().heads == random_weights;
}

std::string Lpips::label() const {
    return config().network + (random() ? ", random weights" : "");
}

ParameterStore& Lpips::parameters() {
    return implementation_->store;
}

}  // namespace stymo
