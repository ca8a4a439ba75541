#include "train/face_picture.h"

#include <algorithm>

#include "core/error.h"
#include "core/io/image.h"
#include "render/head_parts.h"

namespace stymo {
namespace {

Tensor head_of_parsing(Tensor classes) {
    for (float& value : classes.mutable_values<float>()) value = is_head_class(static_cast<int>(value)) ? 1.0F : 0.0F;
    return classes;
}

Tensor merged(Tensor mask, const Tensor& part) {
    if (!(mask.shape() == part.shape())) fail<FileError>("has the size ", part.shape(), ", the part before it ", mask.shape());
    const std::span<float> values = mask.mutable_values<float>();
    const std::span<const float> more = part.values<float>();
    std::transform(values.begin(), values.end(), more.begin(), values.begin(), [](float a, float b) { return std::max(a, b); });
    return mask;
}

/// The message of an error about a file without the file's name, which is said beside it.
std::string reason_of(const Error& error, const std::filesystem::path& file) {
    const std::string message = error.what();
    const std::string prefix = file.string() + ": ";
    return message.starts_with(prefix) ? message.substr(prefix.size()) : message;
}

}  // namespace

FacePicture read_face_picture(const FaceFiles& files) {
    const std::filesystem::path* reading = &files.image;
    try {
        FacePicture picture;
        picture.image = read_image(files.image);
        if (!files.mask.empty()) {
            reading = &files.mask;
            picture.mask = read_mask(files.mask);
        } else if (!files.parsing.empty()) {
            reading = &files.parsing;
            picture.mask = head_of_parsing(read_class_map(files.parsing));
        }
        for (const std::filesystem::path& part : files.mask_parts) {
            reading = &part;
            picture.mask = picture.mask.defined() ? merged(std::move(picture.mask), read_mask(part)) : read_mask(part);
        }
        return picture;
    } catch (const Error& error) {
        return {{}, {}, BrokenFile{reading->string(), reason_of(error, *reading)}};
    }
}

}  // namespace stymo
