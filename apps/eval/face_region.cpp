#include "apps/eval/face_region.h"

#include "core/error.h"
#include "core/io/image.h"
#include "fit/photo/prepared_photos.h"
#include "render/parsing_classes.h"

namespace stymo {

FaceRegion::FaceRegion(const std::filesystem::path& parser) {
    if (!parser.empty()) parser_.emplace(parser);
}

Tensor FaceRegion::mask(const FaceFiles& files, std::int64_t side) {
    if (tells_face_region(files)) return at_model_side(read_face_region(files), side);
    if (!parser_)
        fail<FileError>(files.image.string(),
                        ": nothing tells its face from hair and ears (parsing/", files.id,
                        ".png, CelebAMask-HQ's parts); give --parser");
    const Tensor photo = central_square(read_image(files.image));
    const std::lock_guard lock(parsing_);
    Tensor region = parser_->parse(photo);
    for (float& value : region.mutable_values<float>())
        value = is_face_class(static_cast<int>(value)) ? 1.0F : 0.0F;
    return at_model_side(region, side);
}

}  // namespace stymo
