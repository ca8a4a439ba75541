#include "fit/photo/face_parser.h"

#include <algorithm>
#include <array>

#include "core/error.h"
#include "core/io/image.h"
#include "core/ops/resample.h"
#include "fit/photo/onnx_network.h"
#include "render/head_parts.h"

namespace stymo {
namespace {

constexpr std::size_t class_count = head_part_count;

/// What a kind of network takes and gives: `classes[i]` is CelebAMask-HQ's index of its i-th class.
struct Convention {
    int input_side;
    PixelScale scale;
    std::array<std::size_t, class_count> classes;
};

const Convention& convention_of(FaceParserKind kind) {
    static constexpr Convention celebamask{
        256,
        {{0.5F, 0.5F, 0.5F}, {0.5F, 0.5F, 0.5F}},
        {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16, 17, 18},
    };
    // Background, skin, brows, eyes, glasses, ears, earring, nose, mouth, lips, neck, necklace, cloth, hair, hat.
    static constexpr Convention face_parsing_pytorch{
        512,
        {{0.485F, 0.456F, 0.406F}, {0.229F, 0.224F, 0.225F}},
        {0, 1, 6, 7, 4, 5, 3, 8, 9, 15, 2, 10, 11, 12, 17, 16, 18, 13, 14},
    };
    return kind == FaceParserKind::celebamask ? celebamask : face_parsing_pytorch;
}

/// Class i of a mirror image is this class of the picture: left and right eyes, brows and ears change places.
constexpr std::array<std::size_t, class_count> mirrored_class = {0,  1,  2,  3,  5,  4,  7,  6,  9, 8,
                                                                 10, 11, 12, 13, 14, 15, 16, 17, 18};

/// Logits (side, side, 19) in CelebAMask-HQ's order.
Tensor logits_of(OnnxNetwork& network, const Convention& convention, const Tensor& picture) {
    const OnnxNetwork::Output output = network.run(picture, convention.scale);
    const auto& extents = output.extents;
    if (extents.size() != 4 || extents[1] != head_part_count)
        fail<ShapeError>("the network does not give ", head_part_count, " classes for each pixel");
    Tensor logits({extents[2], extents[3], head_part_count});
    const std::span<float> values = logits.mutable_values<float>();
    const std::size_t plane = values.size() / class_count;
    for (std::size_t channel = 0; channel < class_count; ++channel)
        for (std::size_t i = 0; i < plane; ++i)
            values[i * class_count + convention.classes[channel]] = output.values[channel * plane + i];
    return logits;
}

/// logits += those of the mirror image, turned back.
void add_mirrored(Tensor& logits, const Tensor& of_mirror_image) {
    const Tensor turned = mirror_image(of_mirror_image);
    const std::span<const float> from = turned.values<float>();
    const std::span<float> to = logits.mutable_values<float>();
    for (std::size_t i = 0; i < to.size(); ++i) to[i] += from[i - i % class_count + mirrored_class[i % class_count]];
}

Tensor strongest_class(const Tensor& logits) {
    Tensor classes({logits.shape(0), logits.shape(1), 1});
    const std::span<const float> from = logits.values<float>();
    std::size_t at = 0;
    for (float& result : classes.mutable_values<float>()) {
        const auto pixel = from.subspan(at, class_count);
        result = static_cast<float>(std::distance(pixel.begin(), std::max_element(pixel.begin(), pixel.end())));
        at += class_count;
    }
    return classes;
}

}  // namespace

struct FaceParser::Implementation {
    OnnxNetwork network;
    FaceParserKind kind = FaceParserKind::celebamask;

    /// Why the network cannot be one of this kind, or nothing.
    std::optional<std::string> objection(FaceParserKind candidate) {
        const Convention& convention = convention_of(candidate);
        try {
            static_cast<void>(logits_of(network, convention, Tensor::zeros({convention.input_side, convention.input_side, 3})));
        } catch (const ShapeError& error) {
            return error.what();
        }
        return std::nullopt;
    }
};

FaceParser::FaceParser(const std::filesystem::path& onnx, std::optional<FaceParserKind> kind)
    : implementation_(std::make_unique<Implementation>(Implementation{OnnxNetwork(onnx)})) {
    const bool several = implementation_->network.output_count() > 1;
    if (!kind && !several && !implementation_->objection(FaceParserKind::celebamask)) kind = FaceParserKind::celebamask;
    implementation_->kind = kind.value_or(FaceParserKind::face_parsing_pytorch);
    if (const auto objection = implementation_->objection(implementation_->kind))
        fail<FileError>(onnx.string(), ": not a face parser (", *objection, ")");
}

FaceParser::~FaceParser() = default;
FaceParser::FaceParser(FaceParser&&) noexcept = default;
FaceParser& FaceParser::operator=(FaceParser&&) noexcept = default;

FaceParserKind FaceParser::kind() const {
    return implementation_->kind;
}

Tensor FaceParser::parse(const Tensor& crop) {
    if (crop.rank() != 3 || crop.size() == 0 || crop.shape(2) != 3)
        fail<ShapeError>("[face parser] a crop is (height, width, 3); got ", crop.shape());
    const Convention& convention = convention_of(implementation_->kind);
    const Tensor input = resize_image(crop, convention.input_side, convention.input_side);
    Tensor logits = logits_of(implementation_->network, convention, input);
    add_mirrored(logits, logits_of(implementation_->network, convention, mirror_image(input)));
    const Variable batch = logits.reshaped({1, logits.shape(0), logits.shape(1), head_part_count});
    const Variable resized = resize_bilinear(batch, static_cast<int>(crop.shape(0)), static_cast<int>(crop.shape(1)));
    return strongest_class(resized.value().reshaped({crop.shape(0), crop.shape(1), head_part_count}));
}

}  // namespace stymo
