#include "apps/view/jobs.h"

#include <algorithm>
#include <chrono>
#include <cmath>

#include "apps/common/prepared_photos.h"
#include "apps/common/shipped_file.h"
#include "apps/view/private_file.h"
#include "core/error.h"
#include "core/io/image.h"
#include "core/io/ply_file.h"
#include "fit/edit/color_edit.h"
#include "fit/edit/part_mask.h"
#include "fit/edit/region_at.h"
#include "fit/fitter.h"
#include "fit/photo/face_parser.h"
#include "fit/tuning.h"
#include "nn/models/display_image.h"
#include "nn/models/weight_changes.h"
#include "nn/realtime/head_mesh.h"
#include "nn/realtime/mesh_colors.h"
#include "nn/realtime/view.h"
#include "render/morphable/head_source.h"

namespace stymo::view {

namespace {

using std::chrono_literals::operator""ms;

/// Waits for the other jobs that use all threads.
std::unique_lock<std::timed_mutex> turn(Studio& studio, Job& job) {
    std::unique_lock lock(studio.heavy_work(), std::defer_lock);
    while (!lock.try_lock_for(50ms)) job.report("waiting for another job", 0, 0);
    return lock;
}

PreparedPhoto prepared(Studio& studio, const std::string& bytes, Job& job) {
    job.report("finding the face", 0, 0);
    PhotoPreparationSettings settings;
    settings.landmark_model = shipped_landmark_network();
    // Only the shipped model is known to represent heads of photos, as in stymo-fit.
    const ModelOptions& model = studio.options().model;
    if (model.file.empty() && model.tuned.empty()) settings.mask_model = studio.model().get();
    settings.parser = studio.options().parser;
    settings.most_pixels = studio.options().most_photo_pixels;
    PreparedPhoto photo;
    read_bytes(bytes, "the photo", [&](const std::filesystem::path& file) {
        const std::string name = file.string();
        photo = prepare_photos(std::span(&name, 1), studio.model()->config(), settings).front();
    });
    return photo;
}

/// A model with this face's tuned weights.
std::shared_ptr<const Model> tuned_model(Studio& studio, const FaceBatch& batch,
                                         const FitResult& fitted, const MorphableHead& head,
                                         double seconds, Job& job) {
    auto tuned = std::make_shared<Model>(load_model(studio.options().model, ModelParts::decoder));
    TuningOptions options{.seconds = seconds, .head = &head};
    constexpr std::int64_t parts = 1000;
    options.on_step = [&](const TuningStep& step) {
        const auto part = static_cast<std::int64_t>(parts * step.seconds / seconds);
        job.report("tuning", std::min(part, parts), parts, step.loss);
    };
    static_cast<void>(tune_decoder(*studio.model(), *tuned, studio.loss(), batch, fitted.fitted,
                                   fitted.cameras, options));
    return tuned;
}

/// Keeps the codes close to those of real faces, even for a colour that no face has: steps and
/// offsets are scaled by the variation of the training faces' textures.
void keep_near_faces(const Model& model, ColorEditOptions& options) {
    if (!model.code_statistics()) return;
    constexpr std::size_t texture = 2;
    constexpr double step = 0.1, regularizer = 0.03;
    const std::vector<double> factor = model.code_statistics()->factor().to_vector();
    double variance = 0.0;
    const std::int64_t first = code_sizes[0] + code_sizes[1];
    for (std::int64_t i = first * code_size; i < (first + code_sizes[texture]) * code_size; ++i)
        variance += factor[static_cast<std::size_t>(i)] * factor[static_cast<std::size_t>(i)];
    if (!(variance > 0.0)) return;
    options.learning_rate = step * std::sqrt(variance / static_cast<double>(code_sizes[texture]));
    options.regularizer = regularizer / variance;
}

/// 1 on the part of the head that the user points at. Throws ValueError for a point beside it.
Tensor pointed_part(const Studio& studio, const ShelfFace& face, const ColorWish& wish) {
    const ViewOptions as_shown{
        .samples_per_ray = face.model->config().reconstruction.fit_samples_per_ray, .mask = true};
    const View view = render_view(*face.model, face.face.codes, 0, wish.camera, as_shown);
    const std::int64_t side = view.mask.shape(0);
    const auto index = [&](double part) {
        return std::min(static_cast<std::int64_t>(part * static_cast<double>(side)), side - 1);
    };
    const auto pixel = static_cast<std::size_t>(index(wish.y) * side + index(wish.x));
    const std::span<const float> mask = view.mask.values<float>();
    if (mask[pixel] < 0.5F * std::ranges::max(mask))
        fail<ValueError>("there is no head at this place; click on the hair, the skin or the lips");
    if (studio.options().parser.empty())
        return masked_image(region_at(view.image, wish.x, wish.y), view.mask);
    FaceParser parser(studio.options().parser);
    const Tensor classes = parser.parse_head(view.image, view.mask);
    ParsingClassSet chosen{};
    chosen[static_cast<std::size_t>(classes.values<float>()[pixel])] = true;
    return part_mask(classes, chosen);
}

}  // namespace

Job::Body fit_photo(Studio& studio, Session& session, std::string photo, const std::string& name,
                    double tune_seconds) {
    return [&studio, &session, photo = std::move(photo), name, tune_seconds](Job& job) {
        const auto lock = turn(studio, job);
        const Model& model = *studio.model();
        const PreparedPhoto ready = prepared(studio, photo, job);
        std::string note;
        for (const std::string& warning : ready.warnings)
            note += (note.empty() ? "" : "; ") + warning;
        job.set_note(note);
        const FaceBatch batch =
            make_batch(std::span(&ready.face, 1), model.decoder().ladder().smallest());
        const MorphableHead head = morphable_head_from({});
        ShelfFace shown{name, {face_codes(model, batch), ready.face.pose}, studio.model()};
        const std::string id = session.shelf().add(shown);
        FitResult result;
        try {
            job.set_face(id);
            FitOptions options{.optimizer = FitOptimizer::lbfgs,
                               .steps = studio.options().fit_steps,
                               .head = &head};
            options.on_step = [&](const FitStep& step) {
                shown.face.codes = detached(step.codes);
                session.shelf().replace(id, shown);
                job.report("fitting", step.steps, options.steps, step.loss);
            };
            result = fit_codes(model, studio.loss(), batch, options);
        } catch (...) {
            session.shelf().remove(id);  // removes an unfinished face
            throw;
        }
        shown.face.codes = result.fitted;
        session.shelf().replace(id, shown);
        if (tune_seconds > 0.0) {
            shown.model = tuned_model(studio, batch, result, head, tune_seconds, job);
            shown.tuned = true;
            session.shelf().replace(id, shown);
        }
    };
}

Job::Body recolor(Studio& studio, Session& session, const ShelfFace& shown, const ColorWish& wish) {
    return [&studio, &session, shown, wish](Job& job) {
        const auto lock = turn(studio, job);
        ShelfFace face = shown;
        const Tensor part = pointed_part(studio, face, wish);
        ColorEditOptions options{.steps = studio.options().color_steps};
        keep_near_faces(*studio.model(), options);
        options.on_step = [&](std::int64_t step, double loss) {
            job.report("recolouring", step, options.steps, loss);
        };
        const ColorEdit edit =
            edit_color(*face.model, face.face.codes, wish.camera, part, wish.color, options);
        face.face.codes = edit.codes;
        face.name += ", recoloured";
        job.set_face(session.shelf().add(face));
    };
}

Job::Body film(Studio& studio, const FilmWish& wish) {
    return [&studio, wish](Job& job) {
        const auto lock = turn(studio, job);
        const Model& model = *wish.face.model;
        const FrameSettings& settings = studio.options().frames;
        FaceRenderer renderer(
            model, {.mode = model.decoder().folds() ? settings.moving_mode : RenderMode::exact,
                    .samples_per_ray = model.config().reconstruction.fit_samples_per_ray,
                    .tolerance = settings.tolerance,
                    .remove_floaters = true});
        renderer.show(wish.face.face.codes);
        std::vector<Tensor> frames;
        for (const Camera& camera : wish.cameras) {
            frames.push_back(renderer.render(camera).image);
            job.report("rendering the film", std::ssize(frames), std::ssize(wish.cameras));
        }
        job.report("writing the film", 0, 0);
        const std::string bytes =
            written_bytes(wish.extension, [&](const std::filesystem::path& file) {
                write_animation(file, frames, wish.frames_per_second);
            });
        const bool gif = wish.extension == ".gif";
        job.set_artifact({bytes, gif ? "image/gif" : "video/mp4", "face" + wish.extension});
    };
}

Job::Body mesh(Studio& studio, const ShelfFace& face) {
    return [&studio, face](Job& job) {
        const auto lock = turn(studio, job);
        job.report("making the mesh", 0, 0);
        const TriangleMesh surface = head_mesh(*face.model, face.face.codes, 0, {});
        const Tensor normals = vertex_normals(surface.vertices, surface.triangles);
        job.report("colouring the mesh", 0, 0);
        const Tensor colors = mesh_colors(*face.model, face.face.codes, surface, normals, {});
        const std::string bytes = written_bytes(".ply", [&](const std::filesystem::path& file) {
            write_ply(file, {.vertices = surface.vertices,
                             .normals = normals,
                             .colors = colors,
                             .triangles = surface.triangles});
        });
        job.set_artifact({bytes, "application/octet-stream", "face.ply"});
    };
}

}  // namespace stymo::view
