#include "nn/pretrained/backbones/landmark_backbone.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <vector>

#include "core/error.h"
#include "core/ops/ops.h"
#include "nn/pretrained/landmark_network.h"

namespace stymo {
namespace {

/// Medians of `square_around` over prepared photos, in parts of their side.
constexpr double center_x = 0.5;
constexpr double center_y = 0.645;
constexpr double half_side = 0.315;

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

}  // namespace

std::unique_ptr<Backbone> make_landmark_backbone(ParameterStore& store, const std::string& prefix,
                                                 Rng& rng) {
    return std::make_unique<LandmarkBackbone>(store, prefix, rng);
}

}  // namespace stymo
