#include "nn/pretrained/backbones/small_conv.h"

#include <array>
#include <numbers>
#include <vector>

#include "core/error.h"
#include "core/ops/ops.h"
#include "nn/layers/conv_layer.h"
#include "nn/layers/linear.h"

namespace stymo {
namespace {

constexpr std::int64_t image_side = 64;
constexpr std::int64_t last_side = 2;
constexpr std::int64_t small_conv_channels = 256;
constexpr std::array<std::int64_t, 5> widths{32, 64, 128, 256, 256};

class SmallConv final : public Backbone {
public:
    SmallConv(ParameterStore& store, const std::string& prefix, Rng& rng)
        : layers_(make_layers(store, prefix, rng)),
          embed_(store, prefix + "embed", last_side * last_side * widths.back(),
                 small_conv_channels, {}, rng) {}

    [[nodiscard]] Variable operator()(const Variable& image) const override {
        const bool resize = image.shape(1) != image_side || image.shape(2) != image_side;
        const Variable x = activations(resize ? resize_bicubic(image, static_cast<int>(image_side),
                                                               static_cast<int>(image_side))
                                              : image)
                               .back();
        return embed_(reshape(x, {x.shape(0), -1}));
    }

    [[nodiscard]] bool has_activations() const override { return true; }
    [[nodiscard]] std::vector<Variable> activations(const Variable& image) const override {
        std::vector<Variable> all;
        for (const ConvLayer& layer : layers_)
            all.push_back(layer(all.empty() ? image : all.back(), 0.2) * std::numbers::sqrt2);
        return all;
    }

    [[nodiscard]] std::int64_t embedding_size() const override { return small_conv_channels; }
    [[nodiscard]] std::int64_t input_side() const override { return image_side; }
    [[nodiscard]] std::int64_t saved() const override { return 500'000; }

    void load_pretrained(const TensorFile&, const std::string& source) override {
        fail<ConfigError>(
            "encoder.backbone_weights: small_conv has no published weights to read from ", source,
            "; leave the key empty to train it from scratch");
    }

private:
    static std::vector<ConvLayer> make_layers(ParameterStore& store, const std::string& prefix,
                                              Rng& rng) {
        std::vector<ConvLayer> layers;
        std::int64_t in = 3;
        for (const std::int64_t out : widths) {
            const std::string name = prefix + "conv" + std::to_string(layers.size());
            layers.emplace_back(store, name, in, out,
                                ConvLayerOptions{.stride = 2, .scaling = WeightScaling::equalised},
                                rng);
            in = out;
        }
        return layers;
    }

    std::vector<ConvLayer> layers_;
    Linear embed_;
};

}  // namespace

std::unique_ptr<Backbone> make_small_conv(ParameterStore& store, const std::string& prefix,
                                          Rng& rng) {
    return std::make_unique<SmallConv>(store, prefix, rng);
}

}  // namespace stymo
