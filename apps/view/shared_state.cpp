#include "apps/view/shared_state.h"

#include "apps/common/tool_options.h"
#include "core/error.h"
#include "core/rng.h"
#include "fit/photo/face_parser.h"
#include "nn/realtime/view.h"

namespace stymo::view {

namespace {

constexpr std::int64_t directions_of_group = 6;
/// Faces to begin with where the command line names none.
constexpr std::uint64_t drawn_faces = 6;
constexpr double usual_truncation = 0.7;

/// A fit's folder tells more than its codes.json.
std::string name_of(const std::filesystem::path& file) {
    const std::filesystem::path folder = std::filesystem::absolute(file).parent_path().filename();
    const std::string stem = file.stem().string();
    return stem == "codes" && !folder.empty() ? folder.string() : stem;
}

}  // namespace

SharedState::SharedState(const ViewerOptions& options) : options_(options) {
    if (options.codes.size() > FaceList::most_faces)
        fail<UsageError>("--codes: a page has room for ", FaceList::most_faces, " faces, not for ",
                         options.codes.size());
    model_ = std::make_shared<const Model>(load_model({.file = options.model.file, .tuned = {}}));
    mark_ = model_mark(options.model);
    // Reports unreadable files at the start instead of at the first use by the page.
    if (!options.parser.empty()) static_cast<void>(FaceParser(options.parser));
    if (model_->code_statistics())
        directions_ = leading_directions(*model_->code_statistics(), directions_of_group);
    const bool tuned = !options.model.tuned.empty();
    const auto model_of_codes =
        tuned ? std::make_shared<const Model>(load_model(options.model, ModelParts::decoder))
              : model_;
    for (const std::string& file : options.codes)
        first_faces_.push_back({.name = name_of(file),
                                .face = read_code_file(file, mark_),
                                .model = model_of_codes,
                                .tuned = tuned});
    if (first_faces_.empty() && model_->code_statistics()) {
        for (std::uint64_t seed = 1; seed <= drawn_faces; ++seed)
            first_faces_.push_back({.name = "drawn " + std::to_string(seed),
                                    .face = drawn_face(seed, usual_truncation),
                                    .model = model_});
    }
    if (first_faces_.empty())
        fail<UsageError>("--codes is required: the model has no statistics to draw faces from");
    scheduler_ = std::make_unique<Scheduler>(options_.frames);
}

CodeFile SharedState::drawn_face(std::uint64_t seed, double truncation) const {
    if (!model_->code_statistics())
        fail<ValueError>("this model has no statistics to draw faces from");
    return {model_->code_statistics()->new_face(0, seed, truncation),
            frontal_pose(model_->config().camera)};
}

std::optional<DirectionNames> SharedState::direction_names() {
    const std::lock_guard lock(made_when_needed_);
    if (!naming_)
        naming_ = std::make_unique<Job>([this](Job& job) {
            const std::filesystem::path landmarks = shipped_landmark_network();
            if (!model_->code_statistics() || landmarks.empty()) return;
            direction_names_ =
                stymo::direction_names(*model_, directions_, read_landmark_model(landmarks),
                                       [&job] { job.report("naming the sliders", 0, 0); });
        });
    if (naming_->running()) return std::nullopt;
    return direction_names_;
}

const ReconstructionLoss& SharedState::loss() {
    const std::lock_guard lock(made_when_needed_);
    if (!loss_)
        loss_ = std::make_unique<ReconstructionLoss>(
            model_->config().reconstruction, "stymo-fit --perceptual-weight 0",
            model_->has_encoder() ? &model_->encoder() : nullptr);
    return *loss_;
}

PhotoPreparationSettings SharedState::preparation_settings() const {
    PhotoPreparationSettings settings;
    settings.landmark_model = shipped_landmark_network();
    settings.mask_network = shipped_mask_network();
    settings.most_pixels = options_.most_photo_pixels;
    return settings;
}

std::shared_ptr<const PhotoPreparation> SharedState::preparation() {
    const std::lock_guard lock(preparing_);
    if (!preparation_)
        preparation_ = std::make_shared<const PhotoPreparation>(
            settings_for(model_->config(), preparation_settings()));
    preparation_->detector();
    return preparation_;
}

}  // namespace stymo::view
