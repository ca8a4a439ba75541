#include "fit/photo/face_parser.h"

#include <algorithm>
#include <array>
#include <string>

#include "core/error.h"
#include "core/io/image.h"
#include "core/ops/resample.h"
#include "fit/photo/onnx_network.h"
#include "render/parsing_classes.h"

namespace stymo {
namespace {

constexpr std::size_t class_count = parsing_class_count;

/// Input and output of a kind of network; `classes[i]` is CelebAMask-HQ's index of its i-th class.
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
    // Background, skin, brows, eyes, glasses, ears, earring, nose, mouth, lips, neck, necklace,
    // cloth, hair, hat.
    static constexpr Convention face_parsing_pytorch{
        512,
        {{0.485F, 0.456F, 0.406F}, {0.229F, 0.224F, 0.225F}},
        {0, 1, 6, 7, 4, 5, 3, 8, 9, 15, 2, 10, 11, 12, 17, 16, 18, 13, 14},
    };
    return kind == FaceParserKind::celebamask ? celebamask : face_parsing_pytorch;
}

/// Logits (side, side, 19) in CelebAMask-HQ's order.
Tensor logits_of(OnnxNetwork& network, const Convention& convention, const Tensor& image) {
    const OnnxNetwork::Output output = network.run(image, convention.scale);
    const auto& extents = output.extents;
    if (extents.size() != 4 || extents[1] != parsing_class_count)
        fail<ShapeError>("the network does not give ", parsing_class_count,
                         " classes for each pixel");
    Tensor logits({extents[2], extents[3], parsing_class_count});
    const std::span<float> values = logits.mutable_values<float>();
    const std::size_t plane = values.size() / class_count;
    for (std::size_t channel = 0; channel < class_count; ++channel)
        for (std::size_t i = 0; i < plane; ++i)
            values[i * class_count + convention.classes[channel]] =
                output.values[channel * plane + i];
    return logits;
}

Tensor strongest_class(const Tensor& logits) {
    Tensor classes({logits.shape(0), logits.shape(1), 1});
    const std::span<const float> from = logits.values<float>();
    std::size_t at = 0;
    for (float& result : classes.mutable_values<float>()) {
        const auto pixel = from.subspan(at, class_count);
        result = static_cast<float>(
            std::distance(pixel.begin(), std::max_element(pixel.begin(), pixel.end())));
        at += class_count;
    }
    return classes;
}

/// The most likely head class within the mask, background outside.
Tensor strongest_head_class(const Tensor& logits, const Tensor& mask) {
    Tensor classes(mask.shape());
    const std::span<const float> from = logits.values<float>();
    const std::span<const float> head = mask.values<float>();
    const std::span<float> result = classes.mutable_values<float>();
    for (std::size_t i = 0; i < result.size(); ++i) {
        const auto pixel = from.subspan(i * class_count, class_count);
        auto strongest = static_cast<std::size_t>(ParsingClass::skin);
        for (std::size_t part = 0; part < class_count; ++part)
            if (is_head_class(static_cast<int>(part)) && pixel[part] > pixel[strongest])
                strongest = part;
        result[i] = head[i] < 0.5F ? static_cast<float>(ParsingClass::background)
                                   : static_cast<float>(strongest);
    }
    return classes;
}

}  // namespace

struct FaceParser::Implementation {
    OnnxNetwork network;
    FaceParserKind kind = FaceParserKind::celebamask;

    /// Logits of an aligned crop, at the size of the crop.
    Tensor logits(const Tensor& crop) {
        if (crop.rank() != 3 || crop.size() == 0 || crop.shape(2) != 3)
            fail<ShapeError>("[face parser] a crop is (height, width, 3); got ", crop.shape());
        const Convention& convention = convention_of(kind);
        const Tensor few = logits_of(
            network, convention, resize_image(crop, convention.input_side, convention.input_side));
        const Variable batch = few.reshaped({1, few.shape(0), few.shape(1), parsing_class_count});
        const Variable resized = resize_bilinear(batch, static_cast<int>(crop.shape(0)),
                                                 static_cast<int>(crop.shape(1)));
        return resized.value().reshaped({crop.shape(0), crop.shape(1), parsing_class_count});
    }

    /// Why the network is not of this kind, or nothing if it is.
    std::optional<std::string> objection(FaceParserKind candidate) {
        const Convention& convention = convention_of(candidate);
        try {
            static_cast<void>(
                logits_of(network, convention,
                          Tensor::zeros({convention.input_side, convention.input_side, 3})));
        } catch (const ShapeError& error) {
            return error.what();
        }
        return std::nullopt;
    }
};

FaceParser::FaceParser(const std::filesystem::path& onnx, std::optional<FaceParserKind> kind)
    : implementation_(std::make_unique<Implementation>(Implementation{OnnxNetwork(onnx)})) {
    const bool several = implementation_->network.output_count() > 1;
    if (!kind && !several && !implementation_->objection(FaceParserKind::celebamask))
        kind = FaceParserKind::celebamask;
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
    return strongest_class(implementation_->logits(crop));
}

Tensor FaceParser::parse_head(const Tensor& crop, const Tensor& mask) {
    const Tensor logits = implementation_->logits(crop);
    if (!(mask.shape() == crop.shape().with(2, 1)))
        fail<ShapeError>("[face parser] the mask ", mask.shape(), " does not belong to the crop ",
                         crop.shape());
    return strongest_head_class(logits, mask);
}

}  // namespace stymo
