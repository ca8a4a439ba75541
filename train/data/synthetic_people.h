#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "core/rng.h"
#include "render/camera.h"
#include "render/morphable/textured_heads.h"

namespace stymo {

/// One view of a person who is a mix of textured heads.
struct SyntheticView {
    TexturedPerson person;
    std::vector<float> expression;  ///< weights of the heads' expressions
    std::vector<float> light;       ///< 27, see render/spherical_harmonics.h
    Pose pose;  ///< a camera that has the head, but not all of long hair, in its square
    TexturedSurface surface;  ///< of the person with the expression
};

/// Draws view `view` of a person. The person, two or three heads with uniformly distributed weights
/// and the hair and colours, depends on `rng` alone. Up to four expressions and more often a smile,
/// an open mouth or closed eyes; most of them on both sides. A third of the views are as frontal as
/// those of sample_synthetic_face, the others have a yaw up to 80 and a pitch up to 20 degrees. As
/// in FFHQ's alignment the middle of the face is near the middle of the square, which is as much
/// wider as the head needs.
[[nodiscard]] SyntheticView sample_synthetic_view(const TexturedHeads& heads, const Rng& rng,
                                                  std::int64_t view, const Intrinsics& intrinsics);

struct SyntheticPeopleSettings {
    std::int64_t people = 100;
    std::int64_t views = 8;
    std::int64_t side = 256;
    std::string prefix = "person";  ///< of ids and people
    Intrinsics intrinsics;
};

/// Writes a folder as write_synthetic_faces does: images/person00000_0.png with neck and clothes
/// before a plain background, masks with soft edges, and in faces.jsonl pose, landmarks, person and
/// series; each view has its own light. Person n depends only on rng.split(n). Throws as
/// write_synthetic_faces does.
void write_synthetic_people(const TexturedHeads& heads, const SyntheticPeopleSettings& settings,
                            const Rng& rng, const std::filesystem::path& folder,
                            const std::function<void(std::int64_t)>& progress = {});

}  // namespace stymo
