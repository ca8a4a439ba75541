#include "apps/view/jobs.h"

#include <algorithm>
#include <chrono>
#include <cmath>

#include "apps/common/tool_options.h"
#include "apps/view/private_file.h"
#include "core/error.h"
#include "core/io/image.h"
#include "core/io/mask_file.h"
#include "fit/edit/color_edit.h"
#include "fit/fit_job.h"
#include "fit/photo/face_parser.h"
#include "nn/models/display_image.h"
#include "nn/models/weight_changes.h"
#include "nn/realtime/chosen_tolerance.h"
#include "nn/realtime/mesh_colors.h"
#include "nn/realtime/view.h"
#include "train/data/face_image.h"

namespace stymo::view {

namespace {

using std::chrono_literals::operator""ms;

/// Waits for the other jobs that use all threads.
std::unique_lock<std::timed_mutex> wait_for_heavy_work(SharedState& shared, Job& job) {
    std::unique_lock lock(shared.heavy_work(), std::defer_lock);
    while (!lock.try_lock_for(50ms)) job.report("waiting for another job", 0, 0);
    return lock;
}

FitJobOptions fit_options(const SharedState& shared, double tune_seconds, std::int64_t number) {
    FitJobOptions options;
    options.preparation = shared.preparation_settings();
    options.preparation.face = number;
    options.head = options.preparation.morphable;
    options.fit.steps = shared.options().fit_steps;
    options.tuning.seconds = tune_seconds;
    return options;
}

/// The known pixels of a photo whose cover is white in the file with these bytes; undefined without
/// one.
Tensor known_besides(const std::string& cover, std::int64_t most_pixels) {
    Tensor known;
    if (!cover.empty())
        read_bytes(cover, "the cover", [&](const std::filesystem::path& file) {
            known = known_outside(read_mask_file(file, most_pixels).mask);
        });
    return known;
}

/// The prepared photo whose file has these bytes. Its warnings join the job's note, and its number
/// of faces the status.
PreparedPhoto prepared(const FitJob& fit, const std::string& bytes, const std::string& cover,
                       Job& job) {
    job.report("finding the face", 0, 0);
    const Tensor known = known_besides(cover, fit.options().preparation.most_pixels);
    PreparedPhoto photo;
    read_bytes(bytes, "the photo", [&](const std::filesystem::path& file) {
        const std::string name = file.string();
        photo = fit.prepare({&name, 1}, known).front();
    });
    for (const std::string& warning : photo.warnings) job.add_note(warning);
    job.set_faces(photo.faces);
    return photo;
}

/// Shows a face in the list while it is fitted and tuned.
class ShownFit {
public:
    ShownFit(Session& session, Job& job, const FitJobOptions& options, ListedFace face)
        : faces_(session.faces()),
          job_(job),
          options_(options),
          face_(std::move(face)),
          id_(faces_.add(face_)) {}

    /// Names the face in the job's status and returns what shows each step.
    [[nodiscard]] FitObserver observer() {
        job_.set_face(id_);
        return {.on_fit_step =
                    [this](const FitStep& step) {
                        show(detached(step.codes));
                        job_.report("fitting", step.steps, options_.fit.steps, step.loss);
                    },
                .on_fitted =
                    [this](const FitResult& result) {
                        show(result.fitted);
                        fitted_ = true;
                    },
                .on_tuning_step =
                    [this](const TuningStep& step) {
                        constexpr std::int64_t parts = 1000;
                        const auto part = static_cast<std::int64_t>(parts * step.seconds /
                                                                    options_.tuning.seconds);
                        job_.report("tuning", std::min(part, parts), parts, step.loss);
                    }};
    }
    void show_tuned(Model tuned) {
        face_.model = std::make_shared<const Model>(std::move(tuned));
        face_.tuned = true;
        replace();
    }
    /// Removes the face if the fit has not ended.
    void give_up() {
        if (!fitted_) faces_.remove(id_);
    }

private:
    void show(Codes codes) {
        face_.face.codes = std::move(codes);
        replace();
    }
    /// Who removes a face while it is fitted does not want the fit any more.
    void replace() {
        if (!faces_.replace(id_, face_)) job_.cancel();
    }

    FaceList& faces_;
    Job& job_;
    const FitJobOptions& options_;
    ListedFace face_;
    std::string id_;
    bool fitted_ = false;
};

/// 1 on the part of the head that the user points at. Throws ValueError for a point beside it.
Tensor pointed_part(const SharedState& shared, const ListedFace& face, const ColorQuery& query) {
    const ViewOptions as_shown{
        .samples_per_ray = face.model->config().reconstruction.fit_samples_per_ray, .mask = true};
    const View view = render_view(*face.model, face.face.codes, 0, query.camera, as_shown);
    const std::int64_t side = view.mask.shape(0);
    const auto index = [&](double part) {
        return std::min(static_cast<std::int64_t>(part * static_cast<double>(side)), side - 1);
    };
    const auto pixel = static_cast<std::size_t>(index(query.y) * side + index(query.x));
    const std::span<const float> mask = view.mask.values<float>();
    if (mask[pixel] < 0.5F * std::ranges::max(mask))
        fail<ValueError>("there is no head at this place; click on the hair, the skin or the lips");
    if (shared.options().parser.empty())
        return masked_image(region_at(view.image, query.x, query.y), view.mask);
    FaceParser parser(shared.options().parser);
    const Tensor classes = parser.parse_head(view.image, view.mask);
    ParsingClassSet chosen{};
    chosen[static_cast<std::size_t>(classes.values<float>()[pixel])] = true;
    return part_mask(classes, chosen);
}

}  // namespace

Job::Body fit_photo(SharedState& shared, Session& session, std::string photo, std::string cover,
                    double tune_seconds, std::int64_t number) {
    return [&shared, &session, photo = std::move(photo), cover = std::move(cover), tune_seconds,
            number](Job& job) {
        const auto lock = wait_for_heavy_work(shared, job);
        const FitJob fit(*shared.model(), shared.loss(), fit_options(shared, tune_seconds, number));
        const PreparedPhoto ready = prepared(fit, photo, cover, job);
        FaceBatch batch = fit.batch_of({&ready.face, 1});
        ShownFit shown(session, job, fit.options(),
                       {"photo",
                        {uncorrected_codes(*shared.model(), batch), ready.face.pose},
                        shared.model()});
        try {
            FittedFaces done = fit.fit(std::move(batch), shown.observer());
            for (const std::string& warning : done.warnings) job.add_note(warning);
            if (done.tuned) shown.show_tuned(std::move(*done.tuned));
        } catch (...) {
            shown.give_up();
            throw;
        }
    };
}

Job::Body recolor(SharedState& shared, Session& session, const ListedFace& shown,
                  const ColorQuery& query) {
    return [&shared, &session, shown, query](Job& job) {
        const auto lock = wait_for_heavy_work(shared, job);
        ListedFace face = shown;
        const Tensor part = pointed_part(shared, face, query);
        ColorEditOptions options{.steps = shared.options().color_steps};
        keep_near_faces(*shared.model(), options);
        options.on_step = [&](std::int64_t step, double loss) {
            job.report("recolouring", step, options.steps, loss);
        };
        const ColorEdit edit =
            edit_color(*face.model, face.face.codes, query.camera, part, query.color, options);
        face.face.codes = edit.codes;
        face.name += ", recoloured";
        job.set_face(session.faces().add(face));
    };
}

Job::Body film(SharedState& shared, const ListedFace& face, const FilmQuery& query) {
    return [&shared, face, query](Job& job) {
        const auto lock = wait_for_heavy_work(shared, job);
        const Model& model = *face.model;
        const FrameSettings& settings = shared.options().frames;
        const RendererOptions wanted{
            .mode = model.decoder().folds() ? settings.moving_mode : RenderMode::exact,
            .samples_per_ray = model.config().reconstruction.fit_samples_per_ray,
            .tolerance = *face.tolerance,
            .remove_floaters = true};
        std::vector<FaceView> views;
        for (const Camera& camera : query.cameras) views.push_back({face.face.codes, camera});
        job.report("choosing the tolerance", 0, 0);
        ChosenRenderer chosen = choose_renderer(model, views, wanted, settings.psnr);
        if (tolerates(chosen.mode)) *face.tolerance = chosen.tolerance;
        job.add_note(error_words(chosen));
        chosen.renderer.show(face.face.codes);
        std::vector<Tensor> frames;
        for (const Camera& camera : query.cameras) {
            frames.push_back(chosen.renderer.render(camera).image);
            job.report("rendering the film", std::ssize(frames), std::ssize(query.cameras));
        }
        job.report("writing the film", 0, 0);
        const std::string bytes =
            written_bytes(query.extension, [&](const std::filesystem::path& file) {
                write_animation(file, frames, query.frames_per_second);
            });
        const std::string kind = query.extension == ".mp4" ? "video/" : "image/";
        job.set_artifact({bytes, kind + query.extension.substr(1), "face" + query.extension});
    };
}

Job::Body mesh(SharedState& shared, const ListedFace& face) {
    return [&shared, face](Job& job) {
        const auto lock = wait_for_heavy_work(shared, job);
        job.report("making the mesh", 0, 0);
        const std::string bytes = written_bytes(".ply", [&](const std::filesystem::path& file) {
            write_head_ply(file, *face.model, face.face.codes, {});
        });
        job.set_artifact({bytes, "application/octet-stream", "face.ply"});
    };
}

Job::Body save_tuned(SharedState& shared, const ListedFace& face) {
    return [&shared, face](Job& job) {
        const auto lock = wait_for_heavy_work(shared, job);
        job.report("saving the tuned weights", 0, 0);
        const std::string bytes =
            written_bytes(".safetensors", [&](const std::filesystem::path& file) {
                WeightChanges changes = WeightChanges::between(*shared.model(), *face.model);
                changes.name_face(face.face.codes);
                changes.save(file);
            });
        job.set_artifact({bytes, "application/octet-stream", "tuned.safetensors"});
    };
}

Job::Body open_tuned(SharedState& shared, Session& session, const ListedFace& face,
                     std::string weights) {
    return [&shared, &session, face, weights = std::move(weights)](Job& job) {
        const auto lock = wait_for_heavy_work(shared, job);
        session.faces().require_room_for_tuned();
        job.report("opening the tuned weights", 0, 0);
        ListedFace tuned = face;
        read_bytes(weights, "the file", [&](const std::filesystem::path& file) {
            tuned.model = std::make_shared<const Model>(load_model(
                {.file = shared.options().model.file, .tuned = file}, ModelParts::decoder));
        });
        tuned.tuned = true;
        tuned.name += ", tuned";
        job.set_face(session.faces().add(std::move(tuned)));
    };
}

}  // namespace stymo::view
