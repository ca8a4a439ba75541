#include "nn/pretrained/backbones/mobilefacenet.h"

#include <array>
#include <vector>

#include "core/error.h"
#include "core/ops/ops.h"
#include "nn/layers/batch_norm.h"
#include "nn/layers/conv_layer.h"

namespace stymo {
namespace {

constexpr std::int64_t side = 112;
constexpr std::int64_t embedding_channels = 128;

enum class Clip { none, relu, relu6 };

/// A parameter and the name of its values in the published file.
struct PublishedName {
    Parameter parameter;
    std::string name;
};

/// The building block of the network: convolution without bias, batch norm, rectifier.
class ClippedConv {
public:
    ClippedConv(ParameterStore& store, const std::string& name, std::int64_t in, std::int64_t out,
                ConvLayerOptions options, Clip clip, Rng& rng)
        : conv_(store, name + ".conv", in, out, without_bias(options), rng),
          norm_(store, name + ".norm", out),
          clip_(clip) {}

    [[nodiscard]] Variable operator()(const Variable& x) const {
        const Variable scale = norm_.scale();
        const Variable y = conv_.scaled(x, scale, norm_.shift(scale));
        switch (clip_) {
            case Clip::relu: return relu(y);
            case Clip::relu6: return clamp(y, 0.0, 6.0);
            case Clip::none: break;
        }
        return y;
    }

    void publish(std::vector<PublishedName>& names, const std::string& conv,
                 const std::string& norm) const {
        names.push_back({conv_.weight(), conv + ".weight"});
        names.push_back({norm_.weight(), norm + ".weight"});
        names.push_back({norm_.bias(), norm + ".bias"});
        names.push_back({norm_.running_mean(), norm + ".running_mean"});
        names.push_back({norm_.running_variance(), norm + ".running_var"});
    }

private:
    static ConvLayerOptions without_bias(ConvLayerOptions options) {
        options.bias = false;
        return options;
    }

    ConvLayer conv_;
    BatchNorm norm_;
    Clip clip_;
};

ConvLayerOptions pointwise() {
    return {.kernel = 1, .padding = 0};
}
ConvLayerOptions depthwise(std::int64_t channels, int stride) {
    return {.stride = stride, .groups = static_cast<int>(channels)};
}

/// Inverted residual block: widen, filter each channel, narrow; with a shortcut if the shape stays
/// the same.
struct Bottleneck {
    ClippedConv expand;
    ClippedConv filter;
    ClippedConv project;
    bool shortcut;

    [[nodiscard]] Variable operator()(const Variable& x) const {
        const Variable y = project(filter(expand(x)));
        return shortcut ? x + y : y;
    }
};

struct Stage {
    std::int64_t expansion;
    std::int64_t channels;
    int blocks;
    int first_stride;
};
constexpr std::array<Stage, 5> stages{
    {{2, 64, 5, 2}, {4, 128, 1, 2}, {2, 128, 6, 1}, {4, 128, 1, 2}, {2, 128, 2, 1}}};

class MobileFaceNet final : public Backbone {
public:
    MobileFaceNet(ParameterStore& store, const std::string& prefix, Rng& rng)
        : stem_(store, prefix + "stem", 3, 64, {.stride = 2}, Clip::relu6, rng),
          stem_depthwise_(store, prefix + "stem_depthwise", 64, 64, depthwise(64, 1), Clip::relu,
                          rng),
          stem_pointwise_(store, prefix + "stem_pointwise", 64, 64, pointwise(), Clip::relu, rng),
          blocks_(make_blocks(store, prefix, rng)),
          widen_(store, prefix + "widen", 128, 512, pointwise(), Clip::relu6, rng),
          pool_(store, prefix + "pool", 512, 512, {.kernel = 7, .padding = 0, .groups = 512},
                Clip::none, rng),
          embed_(store, prefix + "embed.conv", 512, embedding_channels, pointwise(), rng),
          embed_norm_(store, prefix + "embed.norm", embedding_channels) {}

    [[nodiscard]] Variable operator()(const Variable& image) const override {
        const bool resize = image.shape(1) != side || image.shape(2) != side;
        Variable x = imagenet_normalised(
            resize ? resize_bicubic(image, static_cast<int>(side), static_cast<int>(side)) : image);
        x = stem_pointwise_(stem_depthwise_(stem_(x)));
        for (const Bottleneck& block : blocks_) x = block(x);
        x = embed_norm_(embed_(pool_(widen_(x))));
        return reshape(x, {x.shape(0), embedding_channels});
    }

    [[nodiscard]] std::int64_t embedding_size() const override { return embedding_channels; }
    [[nodiscard]] std::int64_t input_side() const override { return side; }
    [[nodiscard]] std::int64_t saved() const override { return 8'000'000; }

    void load_pretrained(const TensorFile& file, const std::string& source) override {
        for (const auto& [parameter, name] : published_names()) {
            const auto found = file.tensors.find(name);
            if (found == file.tensors.end())
                fail<FileError>(source, ": no tensor ", name, "; this is not a MobileFaceNet file");
            Tensor value = found->second;
            // Weights are published as (out, in, height, width).
            if (value.rank() == 4) value = permute(value, {0, 2, 3, 1}).value();
            const Tensor& present = parameter.variable().value();
            if (!(value.shape() == present.shape()))
                fail<FileError>(source, ": ", name, " has shape ", found->second.shape(), " where ",
                                present.shape(), " is needed (out, height, width, in)");
            parameter.set_value(value.to(present.dtype()));
        }
    }

    [[nodiscard]] std::vector<PublishedName> published_names() const {
        std::vector<PublishedName> names;
        stem_.publish(names, "conv1.0", "conv1.1");
        stem_depthwise_.publish(names, "dw_conv.depthwise", "dw_conv.bn1");
        stem_pointwise_.publish(names, "dw_conv.pointwise", "dw_conv.bn2");
        for (std::size_t i = 0; i < blocks_.size(); ++i) {
            const std::string block = "features." + std::to_string(i) + ".conv.";
            blocks_[i].expand.publish(names, block + "0.0", block + "0.1");
            blocks_[i].filter.publish(names, block + "1.0", block + "1.1");
            blocks_[i].project.publish(names, block + "2", block + "3");
        }
        widen_.publish(names, "conv2.0", "conv2.1");
        pool_.publish(names, "gdconv.depthwise", "gdconv.bn");
        names.push_back({embed_.weight(), "conv3.weight"});
        names.push_back({embed_.bias(), "conv3.bias"});
        names.push_back({embed_norm_.weight(), "bn.weight"});
        names.push_back({embed_norm_.bias(), "bn.bias"});
        names.push_back({embed_norm_.running_mean(), "bn.running_mean"});
        names.push_back({embed_norm_.running_variance(), "bn.running_var"});
        return names;
    }

private:
    static std::vector<Bottleneck> make_blocks(ParameterStore& store, const std::string& prefix,
                                               Rng& rng) {
        std::vector<Bottleneck> blocks;
        std::int64_t in = 64;
        for (const Stage& stage : stages) {
            for (int i = 0; i < stage.blocks; ++i) {
                const int stride = i == 0 ? stage.first_stride : 1;
                const std::int64_t wide = in * stage.expansion;
                const std::string name = prefix + "block" + std::to_string(blocks.size());
                ClippedConv expand(store, name + ".expand", in, wide, pointwise(), Clip::relu6,
                                   rng);
                ClippedConv filter(store, name + ".filter", wide, wide, depthwise(wide, stride),
                                   Clip::relu6, rng);
                ClippedConv project(store, name + ".project", wide, stage.channels, pointwise(),
                                    Clip::none, rng);
                blocks.push_back({std::move(expand), std::move(filter), std::move(project),
                                  stride == 1 && in == stage.channels});
                in = stage.channels;
            }
        }
        return blocks;
    }

    static Variable imagenet_normalised(const Variable& image) {
        constexpr std::array<double, 3> mean{0.485, 0.456, 0.406};
        constexpr std::array<double, 3> deviation{0.229, 0.224, 0.225};
        std::array<double, 3> factor{};
        std::array<double, 3> offset{};
        for (std::size_t c = 0; c < 3; ++c) {
            factor[c] = 0.5 / deviation[c];
            offset[c] = (0.5 - mean[c]) / deviation[c];
        }
        return image * Tensor::from({3}, factor).to(image.dtype()) +
               Tensor::from({3}, offset).to(image.dtype());
    }

    ClippedConv stem_;
    ClippedConv stem_depthwise_;
    ClippedConv stem_pointwise_;
    std::vector<Bottleneck> blocks_;
    ClippedConv widen_;
    ClippedConv pool_;
    ConvLayer embed_;
    BatchNorm embed_norm_;
};

}  // namespace

std::unique_ptr<Backbone> make_mobilefacenet(ParameterStore& store, const std::string& prefix,
                                             Rng& rng) {
    return std::make_unique<MobileFaceNet>(store, prefix, rng);
}

std::map<std::string, Shape> mobilefacenet_tensors() {
    ParameterStore store;
    Rng rng(0);
    std::map<std::string, Shape> tensors;
    for (const auto& [parameter, name] : MobileFaceNet(store, "", rng).published_names()) {
        const Shape& own = parameter.variable().shape();
        tensors[name] = own.rank() == 4 ? Shape{own[0], own[3], own[1], own[2]} : own;
    }
    return tensors;
}

}  // namespace stymo
