#include "apps/common/face_input.h"

#include <algorithm>
#include <iostream>
#include <ostream>
#include <set>

#include "apps/common/command_line.h"
#include "core/error.h"
#include "core/io/image.h"
#include "core/io/mask_file.h"
#include "fit/photo/prepared_photos.h"
#include "nn/known_pixels.h"
#include "nn/models/code_file.h"
#include "nn/realtime/view.h"
#include "train/data/face_image.h"

namespace stymo {

namespace {

Face face_of_folder(const FaceSource& source, const ModelConfig& config) {
    const Dataset data(source.data, config.decoder.resolution, {.cache_megabytes = 0}, Split::all,
                       config.camera);
    const auto found = std::ranges::find(data.ids(), source.id);
    if (found == data.ids().end())
        fail<FileError>(source.data.string(), ": no face with the id ", source.id,
                        "; give one of its ", data.size(), " ids with --id");
    Face face = data.load_exactly(found - data.ids().begin());
    const DatasetSummary summary = data.summary();
    for (const BrokenFile& file : summary.left_out)
        if (std::filesystem::path(file.file).filename() == "dataset.json" && !face.has_pose)
            std::cerr << "warning: " << file.file << ": " << file.reason
                      << "; the face counts as frontal" << std::endl;
    if (summary.scaled_masks > 0)
        std::cerr << "warning: the mask of " << source.id << " has " << scaled_mask_note
                  << std::endl;
    return face;
}

/// Says so if its values are scaled.
Tensor mask_of_user(const std::filesystem::path& path) {
    MaskFile file = read_mask_file(path);
    if (file.was_scaled)
        std::cerr << "warning: " << path.string() << " has " << scaled_mask_note << std::endl;
    return std::move(file.mask);
}

}  // namespace

void require_photo(const FaceSource& source) {
    if (source.images.empty() && source.data.empty())
        fail<UsageError>("a photo is required: --image FILE, or --data FOLDER and --id NAME");
    if (source.images.size() > 1 && !source.as_it_comes())
        fail<UsageError>(
            "several photos are prepared by the tool itself: leave out --mask, --pose, --data and "
            "--as-is");
    if (source.images.size() > 1 && !source.ignore.empty())
        fail<UsageError>("--ignore belongs to one photo; fit them one by one");
    std::set<std::string> names;
    for (const std::string& image : source.images) {
        const std::string name = std::filesystem::path(image).stem().string();
        if (!names.insert(name).second)
            fail<UsageError>("two photos are called ", name, "; give them different names");
    }
    if (source.data.empty() != source.id.empty())
        fail<UsageError>("--data and --id need each other");
}

Tensor read_image_of_user(const std::filesystem::path& path) {
    std::string doubt;
    Tensor image = read_image(path, usual_most_pixels, &doubt);
    if (!doubt.empty()) std::cerr << "warning: " << path.string() << ": " << doubt << std::endl;
    return image;
}

void write_left_out(std::ostream& stream, std::span<const BrokenFile> left_out) {
    if (!left_out.empty()) stream << left_out_text(left_out) << std::endl;
}

void write_broken_files(std::ostream& stream, const DatasetSummary& summary, std::size_t known) {
    for (std::size_t i = known; i < summary.broken.size(); ++i)
        stream << one_line("skipped " + summary.broken[i].file + ": " + summary.broken[i].reason)
               << std::endl;
}

Tensor read_known(const FaceSource& source) {
    if (source.ignore.empty()) return {};
    const Tensor known = known_outside(mask_of_user(source.ignore));
    if (known_share(known) == 0.0)
        fail<FileError>(source.ignore.string(),
                        ": leaves nothing of the photo; white stands for what is ignored");
    return known;
}

Face read_face(const FaceSource& source, const ModelConfig& config) {
    const std::int64_t side = config.decoder.resolution;
    Face face;
    if (!source.data.empty()) {
        face = face_of_folder(source, config);
    } else {
        face.id = std::filesystem::path(source.images.front()).stem().string();
        face.pose = frontal_pose(config.camera);
        face.intrinsics = config.camera.intrinsics;
        face.mask = Tensor::full({side, side, 1}, 1.0);
    }
    Tensor image;
    const auto require_frame = [&](const Tensor& mask, const std::filesystem::path& file) {
        try {
            if (image.defined()) require_same_frame(mask, image);
        } catch (const Error& error) {
            fail<FileError>(file.string(), ": ", error.what());
        }
    };
    if (!source.images.empty()) {
        image = read_image_of_user(source.images.front());
        face.photo_side = std::min(image.shape(0), image.shape(1));
        face.image = at_model_side(image, side);
    }
    if (!source.mask.empty()) {
        const Tensor mask = mask_of_user(source.mask);
        require_covering(mask, source.mask.string() + ": ");
        require_frame(mask, source.mask);
        face.mask = at_model_side(mask, side);
        face.has_mask = true;
    }
    if (const Tensor known = read_known(source); known.defined()) {
        require_frame(known, source.ignore);
        const Tensor mine = known_at(central_square(known), side, side);
        face.known = face.known.defined() ? where_known(mine, face.known, 0.0).value() : mine;
        if (known_share(face.known) == 0.0)
            fail<FileError>(source.ignore.string(),
                            ": leaves nothing of the photo's central square, which is fitted");
    }
    if (!source.pose.empty()) {
        face.pose = read_pose(source.pose);
        face.has_pose = true;
    }
    return face;
}

}  // namespace stymo
