#include "nn/pretrained/backbones/backbone.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <numbers>

#include "core/error.h"
#include "core/ops/ops.h"
#include "nn/layers/conv_layer.h"
#include "nn/layers/linear.h"
#include "nn/pretrained/backbones/iresnet.h"
#include "nn/pretrained/backbones/mobilefacenet.h"
#include "nn/pretrained/landmark_network.h"

namespace stymo {
namespace {

constexpr std::int64_t image_side = 64;
constexpr std::int64_t last_side = 2;
constexpr std::int64_t small_conv_channels = 256;
constexpr std::size_t level_count = 5;
constexpr std::array<std::int64_t, level_count> widths{32, 64, 128, 256, 256};
constexpr double leaky_slope = 0.2;
constexpr double gain = std::numbers::sqrt2;
/// Residual blocks after each convolution.
using Depths = std::array<int, level_count>;

/// x + second(first(x)), two 3x3 convolutions (He et al. 2016, without batch norm).
struct ResidualBlock {
    ConvLayer first;
    ConvLayer second;

    [[nodiscard]] Variable operator()(const Variable& x) const {
        return x + second(first(x, leaky_slope) * gain);
    }
};

/// Five strided 3x3 convolutions and a linear layer, 64x64 pixels -> 256 numbers; 1.2 million
/// parameters, 18 million multiply-adds without residual blocks. It can be trained from scratch in
/// minutes. Layers have an equalised learning rate and leaky ReLU with slope 0.2 and gain
/// sqrt(2). Any image is resized to 64x64 by antialiased bicubic resampling.
class SmallConv : public Backbone {
public:
    SmallConv(ParameterStore& store, const std::string& prefix, Rng& rng, Depths depths = {})
        : layers_(make_layers(store, prefix, rng)),
          blocks_(make_blocks(store, prefix, depths, rng)),
          embed_(store, prefix + "embed", last_side * last_side * widths.back(),
                 small_conv_channels, {}, rng) {}

    [[nodiscard]] Variable operator()(const Variable& image) const override {
        const bool resize = image.shape(1) != image_side || image.shape(2) != image_side;
        Variable x = resize ? resize_bicubic(image, static_cast<int>(image_side),
                                             static_cast<int>(image_side))
                            : image;
        for (std::size_t level = 0; level < level_count; ++level) {
            x = layers_[level](x, leaky_slope) * gain;
            for (const ResidualBlock& block : blocks_[level]) x = block(x);
        }
        return embed_(reshape(x, {x.shape(0), -1}));
    }

    [[nodiscard]] bool has_activations() const override { return true; }
    /// Those of the strided convolutions alone: fits compute them at each step, of large images.
    [[nodiscard]] std::vector<Variable> activations(const Variable& image) const override {
        std::vector<Variable> all;
        for (const ConvLayer& layer : layers_)
            all.push_back(layer(all.empty() ? image : all.back(), leaky_slope) * gain);
        return all;
    }

    [[nodiscard]] std::int64_t embedding_size() const override { return small_conv_channels; }
    [[nodiscard]] std::int64_t input_side() const override { return image_side; }
    [[nodiscard]] std::int64_t saved() const override { return 500'000; }

    void load_pretrained(const TensorFile&, const std::string& source) override {
        fail<ConfigError>(
            "encoder.backbone_weights: this backbone has no published weights to read from ",
            source, "; leave the key empty to train it from scratch");
    }

private:
    using Blocks = std::array<std::vector<ResidualBlock>, level_count>;

    static std::vector<ConvLayer> make_layers(ParameterStore& store, const std::string& prefix,
                                              Rng& rng) {
        std::vector<ConvLayer> layers;
        std::int64_t in = 3;
        for (const std::int64_t out : widths) {
            const std::string name = prefix + "conv" + std::to_string(layers.size());
            layers.push_back(conv(store, name, in, out, 2, rng));
            in = out;
        }
        return layers;
    }
    static Blocks make_blocks(ParameterStore& store, const std::string& prefix,
                              const Depths& depths, Rng& rng) {
        Blocks blocks;
        for (std::size_t level = 0; level < level_count; ++level) {
            for (int i = 0; i < depths[level]; ++i) {
                const std::string name =
                    prefix + "residual" + std::to_string(level) + "_" + std::to_string(i) + ".";
                const std::int64_t width = widths[level];
                blocks[level].push_back({conv(store, name + "first", width, width, 1, rng),
                                         conv(store, name + "second", width, width, 1, rng)});
            }
        }
        return blocks;
    }
    static ConvLayer conv(ParameterStore& store, const std::string& name, std::int64_t in,
                          std::int64_t out, int stride, Rng& rng) {
        return {store, name, in, out, {.stride = stride, .scaling = WeightScaling::equalised}, rng};
    }

    std::vector<ConvLayer> layers_;
    Blocks blocks_;
    Linear embed_;
};

/// small_conv with five residual blocks; 1.7 million parameters, 113 million multiply-adds.
class SmallResidual final : public SmallConv {
public:
    SmallResidual(ParameterStore& store, const std::string& prefix, Rng& rng)
        : SmallConv(store, prefix, rng, {2, 2, 1, 0, 0}) {}

    [[nodiscard]] std::int64_t saved() const override { return 1'200'000; }
};

/// Medians of `square_around` over prepared photos, in parts of their side.
constexpr double center_x = 0.5;
constexpr double center_y = 0.645;
constexpr double half_side = 0.315;

/// LandmarkFeatures of the network in configs/models/landmarks: 192 numbers, which tell where
/// brows, eyes and lips are and little else. It sees the square of FFHQ's crop in
/// which faces lie on average, resized to 80 x 80 pixels.
class LandmarkBackbone final : public Backbone {
public:
    LandmarkBackbone(ParameterStore& store, const std::string& prefix, Rng& rng)
        : features_(store, prefix, rng), prefix_length_(prefix.size()) {
        std::ranges::copy_if(
            store.all(), std::back_inserter(parameters_),
            [&](const Parameter& parameter) { return parameter.name().starts_with(prefix); });
    }

    [[nodiscard]] Variable operator()(const Variable& image) const override {
        const auto side = static_cast<double>(image.shape(1));
        const std::int64_t length = std::lround(2.0 * half_side * side);
        const auto cut = [&](const Variable& x, int axis, double center) {
            const std::int64_t begin =
                std::lround(side * center - 0.5 * static_cast<double>(length));
            return slice(x, axis, begin, begin + length);
        };
        const auto input = static_cast<int>(input_side());
        const Variable square = cut(cut(image, 1, center_y), 2, center_x);
        return features_(resize_bicubic(square, input, input) * 0.5 + 0.5);
    }

    [[nodiscard]] std::int64_t embedding_size() const override { return LandmarkFeatures::count; }
    [[nodiscard]] std::int64_t input_side() const override { return LandmarkFeatures::input_side; }
    [[nodiscard]] std::int64_t saved() const override { return 400'000; }

    void load_pretrained(const TensorFile& file, const std::string& source) override {
        for (const Parameter& parameter : parameters_) {
            const std::string name = "landmarks." + parameter.name().substr(prefix_length_);
            const auto found = file.tensors.find(name);
            const Tensor& present = parameter.variable().value();
            if (found == file.tensors.end() || !(found->second.shape() == present.shape()))
                fail<FileError>(source, ": not a landmark network of stymo (no tensor ", name,
                                " of shape ", present.shape(), ")");
            parameter.set_value(found->second.to(present.dtype()));
        }
    }

private:
    LandmarkFeatures features_;
    std::size_t prefix_length_;
    std::vector<Parameter> parameters_;
};

template <class Network>
std::unique_ptr<Backbone> made(ParameterStore& store, const std::string& prefix, Rng& rng) {
    return std::make_unique<Network>(store, prefix, rng);
}

struct Entry {
    const char* name;
    std::unique_ptr<Backbone> (*make)(ParameterStore& store, const std::string& prefix, Rng& rng);
    const char* published;  ///< how to get its trained weights; empty: there are none
};

constexpr const char* insightface =
    "import backbone.pth of github.com/deepinsight/insightface with `stymo-weights import`";

/// The list of all backbones. To add one: a class here or in a file of this folder, a row, and a
/// row in the test's table.
constexpr std::array<Entry, 6> registry{{
    {"iresnet100", make_iresnet100, insightface},
    {"iresnet50", make_iresnet50, insightface},
    {"landmarks", made<LandmarkBackbone>,
     "stymo has them, configs/models/landmarks/landmarks.safetensors"},
    {"mobilefacenet", make_mobilefacenet,
     "import weights/mobilefacenet.pt of github.com/foamliu/MobileFaceNet with "
     "`stymo-weights import`"},
    {"small_conv", made<SmallConv>, ""},
    {"small_residual", made<SmallResidual>, ""},
}};

const Entry& entry_of(const std::string& name) {
    for (const Entry& entry : registry)
        if (name == entry.name) return entry;
    std::string known;
    for (const Entry& entry : registry)
        known += (known.empty() ? "" : ", ") + std::string(entry.name);
    fail<ConfigError>("encoder.backbone: no backbone is called \"", name, "\"; choose one of ",
                      known);
}

}  // namespace

std::vector<Variable> Backbone::activations(const Variable&) const {
    fail<ValueError>("this backbone does not give its activations");
}

std::vector<std::string> backbone_names() {
    std::vector<std::string> names;
    for (const Entry& entry : registry) names.emplace_back(entry.name);
    return names;
}

std::unique_ptr<Backbone> make_backbone(const std::string& name, ParameterStore& store,
                                        const std::string& prefix, Rng& rng) {
    return entry_of(name).make(store, prefix, rng);
}

const char* published_weights(const std::string& backbone) {
    return entry_of(backbone).published;
}

}  // namespace stymo
