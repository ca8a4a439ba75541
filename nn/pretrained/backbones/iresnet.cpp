#include "nn/pretrained/backbones/iresnet.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <optional>
#include <utility>
#include <vector>

#include "core/error.h"
#include "core/ops/ops.h"
#include "nn/layers/batch_norm.h"
#include "nn/layers/conv_layer.h"

namespace stymo {
namespace {

constexpr double weight_deviation = 0.1;
constexpr double initial_slope = 0.25;

/// Mean square of the inputs of an untrained network's layers.
constexpr double image_square = 1.0 / 3.0;  // uniform in [-1, 1]
constexpr double rectified_square = 0.5 * (1.0 + initial_slope * initial_slope);

/// Convolution without bias and the batch norm after it, as one convolution.
class NormalisedConv {
public:
    /// `input_square`: mean square of the inputs that the stored variance is prepared for.
    NormalisedConv(ParameterStore& store, const std::string& conv, const std::string& norm,
                   std::int64_t in, std::int64_t out, ConvLayerOptions options, double input_square,
                   Rng& rng)
        : conv_(store, conv, in, out, with_insightface_start(options), rng),
          norm_(store, norm, out, {.initial_variance = output_square(in, options, input_square)}) {}

    [[nodiscard]] Variable operator()(const Variable& x) const {
        const Variable scale = norm_.scale();
        return conv_.scaled(x, scale, norm_.shift(scale));
    }

private:
    static ConvLayerOptions with_insightface_start(ConvLayerOptions options) {
        options.bias = false;
        options.initial_deviation = weight_deviation;
        return options;
    }
    static double output_square(std::int64_t in, const ConvLayerOptions& options,
                                double input_square) {
        const auto fan_in = static_cast<double>(in * options.kernel * options.kernel);
        return fan_in * weight_deviation * weight_deviation * input_square;
    }

    ConvLayer conv_;
    BatchNorm norm_;
};

Parameter create_slope(ParameterStore& store, const std::string& name, std::int64_t channels) {
    return store.create(name + ".weight", Tensor::full({channels}, initial_slope));
}

/// Residual block: norm, convolution, rectifier, convolution, added to the identity or, where the
/// shape changes, to a convolution.
struct Block {
    BatchNorm norm;
    NormalisedConv conv1;
    Parameter slope;
    NormalisedConv conv2;
    std::optional<NormalisedConv> shortcut;

    [[nodiscard]] Variable operator()(const Variable& x) const {
        const Variable y = conv2(prelu(conv1(norm(x)), slope.variable()));
        return y + (shortcut ? (*shortcut)(x) : x);
    }
};

Block make_block(ParameterStore& store, const std::string& name, std::int64_t in, std::int64_t out,
                 int stride, double input_square, Rng& rng) {
    BatchNorm norm(store, name + ".bn1", in, {.initial_variance = input_square});
    NormalisedConv conv1(store, name + ".conv1", name + ".bn2", in, out, {}, 1.0, rng);
    Parameter slope = create_slope(store, name + ".prelu", out);
    NormalisedConv conv2(store, name + ".conv2", name + ".bn3", out, out, {.stride = stride},
                         rectified_square, rng);
    std::optional<NormalisedConv> shortcut;
    if (stride != 1 || in != out) {
        shortcut.emplace(store, name + ".downsample.0", name + ".downsample.1", in, out,
                         ConvLayerOptions{.kernel = 1, .stride = stride, .padding = 0},
                         input_square, rng);
    }
    return {std::move(norm), std::move(conv1), std::move(slope), std::move(conv2),
            std::move(shortcut)};
}

class Iresnet final : public Backbone {
public:
    Iresnet(const IresnetLayout& layout, ParameterStore& store, const std::string& prefix, Rng& rng)
        : layout_(layout),
          prefix_(prefix),
          stem_(store, prefix + "conv1", prefix + "bn1", 3, layout.widths[0], {}, image_square,
                rng),
          stem_slope_(create_slope(store, prefix + "prelu", layout.widths[0])),
          blocks_(make_blocks(layout, store, prefix, rng)),
          last_norm_(store, prefix + "bn2", layout.widths[3],
                     {.initial_variance = 1.0 + layout.blocks[3]}),
          embed_(store, prefix + "fc", flattened(layout), layout.embedding_size,
                 embed_options(layout), rng),
          features_(store, prefix + "features", layout.embedding_size,
                    {.fixed_weight = true, .initial_variance = 1.0 / 3.0}),
          parameters_(parameters_under(prefix, store)) {}

    [[nodiscard]] Variable operator()(const Variable& image) const override {
        const std::int64_t side = layout_.input_side;
        const bool resize = image.shape(1) != side || image.shape(2) != side;
        Variable x =
            resize ? resize_bicubic(image, static_cast<int>(side), static_cast<int>(side)) : image;
        x = prelu(stem_(x), stem_slope_.variable());
        for (const Block& block : blocks_) x = block(x);
        x = embed_(reshape(last_norm_(x), {x.shape(0), 1, 1, -1}));
        return features_(reshape(x, {x.shape(0), layout_.embedding_size}));
    }

    [[nodiscard]] std::int64_t embedding_size() const override { return layout_.embedding_size; }
    [[nodiscard]] std::int64_t input_side() const override { return layout_.input_side; }
    [[nodiscard]] std::int64_t saved() const override { return layout_.saved; }

    void load_pretrained(const TensorFile& file, const std::string& source) override {
        std::vector<std::pair<Parameter, Tensor>> found;
        for (const Parameter& parameter : parameters_) {
            const std::string name = published_name(parameter);
            const auto entry = file.tensors.find(name);
            if (entry == file.tensors.end())
                fail<FileError>(source, ": no tensor ", name,
                                "; this is not a file of insightface's network of this size");
            const Tensor& present = parameter.variable().value();
            const Shape published = published_shape(name, present.shape());
            if (!(entry->second.shape() == published))
                fail<FileError>(source, ": ", name, " has shape ", entry->second.shape(),
                                ", the network needs ", published);
            found.emplace_back(
                parameter,
                channels_last(name, entry->second).reshaped(present.shape()).to(present.dtype()));
        }
        // Assigned only after all of them have been checked, so that a bad file leaves the network
        // unchanged.
        for (auto& [parameter, value] : found) parameter.set_value(std::move(value));
    }

private:
    static std::vector<Block> make_blocks(const IresnetLayout& layout, ParameterStore& store,
                                          const std::string& prefix, Rng& rng) {
        std::vector<Block> blocks;
        std::int64_t in = layout.widths[0];
        double square = rectified_square;
        for (std::size_t stage = 0; stage < layout.blocks.size(); ++stage) {
            for (int i = 0; i < layout.blocks[stage]; ++i) {
                const std::string name =
                    prefix + "layer" + std::to_string(stage + 1) + "." + std::to_string(i);
                blocks.push_back(
                    make_block(store, name, in, layout.widths[stage], i == 0 ? 2 : 1, square, rng));
                in = layout.widths[stage];
                // Each branch adds values of unit size: the mean square is 2 after a stage's first
                // block, and grows by 1 with every other block.
                square = i == 0 ? 2.0 : square + 1.0;
            }
        }
        return blocks;
    }

    static std::vector<Parameter> parameters_under(const std::string& prefix,
                                                   const ParameterStore& store) {
        std::vector<Parameter> parameters;
        std::ranges::copy_if(
            store.all(), std::back_inserter(parameters),
            [&](const Parameter& parameter) { return parameter.name().starts_with(prefix); });
        return parameters;
    }

    static std::int64_t last_side(const IresnetLayout& layout) { return layout.input_side / 16; }
    static std::int64_t flattened(const IresnetLayout& layout) {
        return last_side(layout) * last_side(layout) * layout.widths[3];
    }
    /// The initial standard deviation of PyTorch's fully connected layers.
    static ConvLayerOptions embed_options(const IresnetLayout& layout) {
        return {.kernel = 1,
                .padding = 0,
                .initial_deviation = 1.0 / std::sqrt(3.0 * static_cast<double>(flattened(layout)))};
    }

    [[nodiscard]] std::string published_name(const Parameter& parameter) const {
        std::string name = parameter.name().substr(prefix_.size());
        if (name.ends_with("running_variance")) name.replace(name.size() - 8, 8, "var");
        return name;
    }
    /// Convolutions are published as (out, in, height, width), the last layer as (out, in).
    [[nodiscard]] static Shape published_shape(const std::string& name, const Shape& shape) {
        if (name == "fc.weight") return {shape[0], shape[3]};
        return shape.rank() == 4 ? Shape{shape[0], shape[3], shape[1], shape[2]} : shape;
    }
    [[nodiscard]] Tensor channels_last(const std::string& name, const Tensor& value) const {
        // The published image is flattened channel by channel, ours pixel by pixel.
        const std::int64_t side = last_side(layout_);
        if (name == "fc.weight")
            return permute(value.reshaped({value.shape(0), layout_.widths[3], side, side}),
                           {0, 2, 3, 1})
                .value();
        return value.rank() == 4 ? permute(value, {0, 2, 3, 1}).value() : value;
    }

    IresnetLayout layout_;
    std::string prefix_;
    NormalisedConv stem_;
    Parameter stem_slope_;
    std::vector<Block> blocks_;
    BatchNorm last_norm_;
    ConvLayer embed_;
    BatchNorm features_;
    std::vector<Parameter> parameters_;
};

}  // namespace

std::unique_ptr<Backbone> make_iresnet(const IresnetLayout& layout, ParameterStore& store,
                                       const std::string& prefix, Rng& rng) {
    if (layout.input_side < 16 || layout.input_side % 16 != 0)
        fail<ValueError>("iresnet: the input's side must be a multiple of 16; got ",
                         layout.input_side);
    return std::make_unique<Iresnet>(layout, store, prefix, rng);
}

std::unique_ptr<Backbone> make_iresnet50(ParameterStore& store, const std::string& prefix,
                                         Rng& rng) {
    return make_iresnet({.blocks = iresnet_depths[2].blocks, .saved = 27'000'000}, store, prefix,
                        rng);
}

std::unique_ptr<Backbone> make_iresnet100(ParameterStore& store, const std::string& prefix,
                                          Rng& rng) {
    return make_iresnet({.blocks = iresnet_depths[3].blocks, .saved = 50'000'000}, store, prefix,
                        rng);
}

}  // namespace stymo
