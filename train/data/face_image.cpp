#include "train/data/face_image.h"

#include <algorithm>
#include <array>
#include <cstdlib>
#include <string_view>

#include "core/error.h"
#include "core/io/image.h"
#include "core/io/mask_file.h"
#include "nn/known_pixels.h"
#include "render/parsing_classes.h"

namespace stymo {
namespace {

/// 1 where `belongs` is true for the class, else 0.
Tensor part_of_parsing(Tensor classes, bool (*belongs)(int)) {
    for (float& value : classes.mutable_values<float>())
        value = belongs(static_cast<int>(value)) ? 1.0F : 0.0F;
    return classes;
}

/// Whether a part of the head, a file "00012_hair.png", is one of the face.
bool is_face_part(const std::filesystem::path& file) {
    constexpr std::array<std::string_view, 4> others{"hair", "l_ear", "r_ear", "ear_r"};
    const std::string stem = file.stem().string();
    return std::ranges::find(others, std::string_view(stem).substr(stem.find('_') + 1)) ==
           others.end();
}

Tensor merged(Tensor mask, const Tensor& part) {
    if (!(mask.shape() == part.shape()))
        fail<FileError>("has the size ", part.shape(), ", the part before it ", mask.shape());
    const std::span<float> values = mask.mutable_values<float>();
    const std::span<const float> more = part.values<float>();
    std::transform(values.begin(), values.end(), more.begin(), values.begin(),
                   [](float a, float b) { return std::max(a, b); });
    return mask;
}

/// An error's message without the file's name, which is printed before it.
std::string reason_of(const Error& error, const std::filesystem::path& file) {
    const std::string message = error.what();
    const std::string prefix = file.string() + ": ";
    return message.starts_with(prefix) ? message.substr(prefix.size()) : message;
}

}  // namespace

void require_same_frame(const Tensor& mask, const Tensor& image) {
    const std::int64_t difference = mask.shape(0) * image.shape(1) - mask.shape(1) * image.shape(0);
    if (std::abs(difference) > std::max(image.shape(0), image.shape(1)))
        fail<FileError>("has ", mask.shape(1), " x ", mask.shape(0), " pixels, its image ",
                        image.shape(1), " x ", image.shape(0), "; the frames must agree");
}

Tensor known_outside(Tensor unknown) {
    // A drawn edge or the noise of a JPEG is not white.
    constexpr float least_unknown = 0.1F;
    for (float& value : unknown.mutable_values<float>())
        value = value < least_unknown ? 1.0F : 0.0F;
    return unless_all_known(unknown);
}

FaceImage read_face_image(const FaceFiles& files, std::int64_t most_pixels) {
    const std::filesystem::path* reading = &files.image;
    try {
        FaceImage image;
        image.image = read_image(files.image, most_pixels, &image.doubt);
        const auto read = [&](const std::filesystem::path& path) {
            MaskFile file = read_mask_file(path);
            image.scaled_mask = image.scaled_mask || file.was_scaled;
            return std::move(file.mask);
        };
        if (!files.mask.empty()) {
            reading = &files.mask;
            image.mask = read(files.mask);
        } else if (!files.parsing.empty()) {
            reading = &files.parsing;
            image.mask = part_of_parsing(read_class_map(files.parsing), is_head_class);
        } else {
            for (const std::filesystem::path& part : files.mask_parts) {
                reading = &part;
                image.mask =
                    image.mask.defined() ? merged(std::move(image.mask), read(part)) : read(part);
            }
        }
        if (image.mask.defined()) {
            require_same_frame(image.mask, image.image);
            require_covering(image.mask);
        }
        if (!files.unknown.empty()) {
            reading = &files.unknown;
            image.known = known_outside(read(files.unknown));
            if (image.known.defined()) require_same_frame(image.known, image.image);
            if (known_share(image.known) == 0.0)
                fail<FileError>("leaves nothing of the photo; white stands for what is unknown");
        }
        return image;
    } catch (const Error& error) {
        return {.broken = BrokenFile{reading->string(), reason_of(error, *reading)}};
    }
}

bool tells_face_region(const FaceFiles& files) {
    return !files.parsing.empty() || std::ranges::any_of(files.mask_parts, is_face_part);
}

Tensor read_face_region(const FaceFiles& files) {
    if (!files.parsing.empty())
        return part_of_parsing(read_class_map(files.parsing), is_face_class);
    Tensor region;
    for (const std::filesystem::path& part : files.mask_parts) {
        if (!is_face_part(part)) continue;
        try {
            Tensor mask = read_mask_file(part).mask;
            region = region.defined() ? merged(std::move(region), mask) : std::move(mask);
        } catch (const Error& error) {
            fail<FileError>(part.string(), ": ", reason_of(error, part));
        }
    }
    if (!region.defined()) fail<ValueError>(files.id, ": no parsing and no parts of the face");
    return region;
}

}  // namespace stymo
