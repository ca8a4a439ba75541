#include "fit/video/film_frame.h"

#include <utility>
#include <vector>

#include "core/parallel.h"
#include "fit/photo/alignment.h"
#include "fit/photo/prepared_photos.h"

namespace stymo {

void prepare_frames(const PhotoPreparation& preparation, const ModelConfig& model,
                    std::span<FrameInWork> frames, bool have_masks) {
    std::vector<std::optional<FaceCrop>> crops(frames.size());
    parallel_for(std::ssize(frames), 1, [&](std::int64_t begin, std::int64_t end) {
        for (auto i = static_cast<std::size_t>(begin); i < static_cast<std::size_t>(end); ++i) {
            FrameInWork& frame = frames[i];
            if (!frame.tracked) continue;
            crops[i] = preparation.frame_crop(frame.image, frame.tracked->smooth, have_masks);
            frame.image = {};
        }
    });
    std::vector<FaceCrop> found;
    for (std::size_t i = 0; i < crops.size(); ++i) {
        if (!crops[i]) continue;
        frames[i].target = crops[i]->fit_target;
        found.push_back(std::move(*crops[i]));
    }
    std::vector<PreparedFace> prepared = preparation.finish(std::move(found), {.pixels = false});
    auto next = prepared.begin();
    for (FrameInWork& frame : frames) {
        if (!frame.tracked) continue;
        PreparedFace& face = *next++;
        if (!face.failure.empty()) {
            frame.tracked.reset();
            continue;
        }
        const Alignment square = ffhq_alignment(frame.tracked->smooth);
        frame.face = face_of_crop(face, preparation.settings(), model);
        frame.frame.pose = frame.face.pose;
        // Angles in the image are clockwise, and a head that leans clockwise has a positive roll.
        frame.frame.roll = frame.face.pose.roll + square.angle();
        frame.frame.landmarks = frame.tracked->found;
    }
}

FaceBatch batch_of(const Model& model, std::span<const FrameInWork> frames, std::int64_t side) {
    std::vector<Face> faces;
    for (const FrameInWork& frame : frames) faces.push_back(frame.face);
    return make_batch(faces, model.decoder().ladder().smallest(), side);
}

}  // namespace stymo
