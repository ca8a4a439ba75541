#include "apps/render/images.h"

#include <algorithm>
#include <cmath>
#include <iomanip>
#include <iostream>
#include <sstream>

#include "apps/common/command_line.h"
#include "apps/common/explain.h"
#include "apps/common/face_input.h"
#include "apps/common/table.h"
#include "core/error.h"
#include "core/interrupt.h"
#include "core/io/folder_in_progress.h"
#include "core/io/image.h"
#include "core/ops/shape_ops.h"
#include "core/progress.h"
#include "nn/realtime/pixel_depth.h"
#include "nn/realtime/view.h"
#include "render/soft_edge.h"
#include "train/training_codes.h"

namespace stymo {

namespace {

Camera camera_of(const Shot& shot, const Model& model) {
    return camera_from_pose(shot.pose, model.config().camera.intrinsics);
}

ChosenRenderer renderer_with(const Model& model, const RendererOptions& options) {
    return {.renderer = FaceRenderer(model, options),
            .mode = options.mode,
            .tolerance = options.tolerance,
            .error = {}};
}

ChosenRenderer depth_renderer(const RenderOptions& options, const Model& model) {
    // Measured on the model that ships, it moves no pixel's depth by half a millimetre.
    constexpr double tolerance_of_depths = 0.01;
    RendererOptions wanted = options.renderer;
    wanted.remove_floaters = !options.keep_floaters;
    wanted.depth = true;
    wanted.mask = false;
    if (!model.decoder().folds()) wanted.mode = RenderMode::exact;
    wanted.tolerance = options.tolerance.value_or(tolerance_of_depths);
    return renderer_with(model, wanted);
}

ChosenRenderer image_renderer(const RenderOptions& options, const Model& model,
                              const std::vector<Shot>& shots) {
    RendererOptions wanted = options.renderer;
    wanted.remove_floaters = !options.keep_floaters;
    wanted.depth = false;
    wanted.mask = wanted.mask || options.cutout || !options.raw;
    if (!model.decoder().folds() && !options.tolerance) wanted.mode = RenderMode::exact;
    if (options.tolerance && tolerates(wanted.mode)) {
        wanted.tolerance = *options.tolerance;
        return renderer_with(model, wanted);
    }
    std::vector<FaceView> views;
    for (const Shot& shot : shots) views.push_back({shot.codes, camera_of(shot, model)});
    return choose_renderer(model, views, wanted, options.psnr);
}

/// Throws UsageError for images, which are written at the end, that hardly any machine could hold.
void require_room(const RenderOptions& options, const Model& model, std::size_t frames,
                  bool animation) {
    constexpr double gibibyte = 1024.0 * 1024.0 * 1024.0, most = 4.0;
    const std::int64_t wanted = options.renderer.resolution;
    const std::int64_t side = wanted == 0 ? model.decoder().ladder().largest() : wanted;
    // Beside the image one channel of the mask, and three of its grey image; and one of the depth.
    const int channels = 3 + (options.renderer.mask ? 4 : 0) + (options.renderer.depth ? 1 : 0);
    const double needed = static_cast<double>(frames) * static_cast<double>(side * side) *
                          channels * sizeof(float) / gibibyte;
    if (needed <= most) return;
    const char* const number = options.orbit > 0    ? "--orbit"
                               : options.sample > 0 ? "--sample"
                               : options.grid()     ? "--grid-yaw and --grid-pitch"
                                                    : "--frames";
    fail<UsageError>(number, ": ", frames, animation ? " frames of " : " images of ", side, " x ",
                     side, " pixels need ", decimal(needed, 1), " GiB of memory, more than ",
                     decimal(most, 0), "; give a smaller ", number, " or --size");
}

std::vector<View> views(const RenderOptions& options, const Model& model,
                        const std::vector<Shot>& shots, FaceRenderer& renderer) {
    std::vector<View> result;
    const InterruptGuard guard;
    std::optional<Progress> progress;
    if (shots.size() > 1)
        progress.emplace(ProgressTask{
            .title = "render", .total = static_cast<std::int64_t>(shots.size()), .unit = "frames"});
    std::optional<ChosenRenderer> of_depth;
    if (options.renderer.depth && !options.depth_alone())
        of_depth.emplace(depth_renderer(options, model));
    FaceRenderer& depths = of_depth ? of_depth->renderer : renderer;
    const Decoder& decoder = model.decoder();
    const std::int64_t wanted = options.renderer.resolution;
    const std::int64_t side = wanted == 0 ? decoder.ladder().largest() : wanted;
    for (const Shot& shot : shots) {
        if (interrupted()) fail<Error>("interrupted; nothing was written");
        const Camera camera = camera_of(shot, model);
        View& view = result.emplace_back();
        if (!options.depth_alone()) {
            renderer.show(shot.codes);
            view = renderer.render(camera);
            if (!options.raw && !options.cutout) view.image = with_soft_edge(view.image, view.mask);
            if (!options.renderer.mask && !options.cutout) view.mask = Tensor();
        }
        if (of_depth || options.depth_alone()) {
            depths.show(shot.codes);
            view.depth = pixel_depth(depths, camera, decoder.rays_per_side(side), side);
        }
        if (progress) progress->update(static_cast<std::int64_t>(result.size()));
    }
    if (progress) progress->finish();
    return result;
}

/// What was measured, in one line.
void report(const ChosenRenderer& chosen) {
    if (chosen.error.views == 0) return;
    std::cerr << std::setprecision(3) << name_of(chosen.mode) << ", tolerance " << chosen.tolerance
              << ": " << error_words(chosen) << std::endl;
}

std::vector<Tensor> images_of(const std::vector<View>& views, Tensor View::*part) {
    std::vector<Tensor> images;
    for (const View& view : views) images.push_back(view.*part);
    return images;
}

/// RGB and alpha of views of the head. The image keeps its colours where the head is not opaque:
/// divided by the opacity, the brighter of them would become a white rim.
std::vector<Tensor> cutouts(const std::vector<View>& views, bool raw) {
    std::vector<Tensor> images;
    for (const View& view : views) {
        const Tensor alpha = raw ? view.mask : soft_opacity(view.mask);
        images.push_back(concat({Variable(view.image), Variable(alpha)}, 2).value());
    }
    return images;
}

/// One channel repeated as the three channels of animations.
Tensor grey(const Tensor& image) {
    Tensor result({image.shape(0), image.shape(1), 3});
    const std::span<float> values = result.mutable_values<float>();
    std::size_t next = 0;
    for (const float value : image.values<float>()) {
        for (int channel = 0; channel < 3; ++channel) values[next++] = value;
    }
    return result;
}

/// The frames there and back; the first and the last one occur once.
std::vector<Tensor> returning(std::vector<Tensor> frames) {
    for (std::size_t i = frames.size() - 1; i-- > 1;) frames.push_back(frames[i]);
    return frames;
}

std::string numbered(std::size_t number) {
    std::ostringstream text;
    text << std::setw(4) << std::setfill('0') << number;
    return text.str();
}

}  // namespace

WrittenImages write_images(const std::filesystem::path& out, const RenderOptions& options,
                           const Model& model, const ShotList& list) {
    const bool animation = is_animation(out);
    require_room(options, model, list.shots.size(), animation);
    ChosenRenderer chosen = options.depth_alone() ? depth_renderer(options, model)
                                                  : image_renderer(options, model, list.shots);
    report(chosen);
    const std::vector<View> seen = views(options, model, list.shots, chosen.renderer);
    count_for_report(chosen.renderer.counts());
    WrittenImages result{.files = {},
                         .mode = chosen.mode,
                         .tolerance = chosen.tolerance,
                         .error = chosen.error.views > 0 ? std::optional(chosen.error)
                                                         : std::optional<FrameError>()};
    std::vector<std::filesystem::path>& written = result.files;
    if (options.depth_alone()) {
        write_exr(written.emplace_back(out),
                  tile_images(images_of(seen, &View::depth), list.columns));
        return result;
    }
    const auto beside = [&](const std::string& suffix) {
        std::filesystem::path path = out;
        path.replace_extension();
        path += suffix;
        return written.emplace_back(path);
    };
    const auto write = [&](const std::filesystem::path& path, const std::vector<Tensor>& images) {
        if (animation) {
            write_animation(path, list.returning ? returning(images) : images,
                            options.frames_per_second);
        } else {
            write_image(path, tile_images(images, list.columns));
        }
    };
    write(written.emplace_back(out),
          options.cutout ? cutouts(seen, options.raw) : images_of(seen, &View::image));
    if (options.renderer.mask) {
        std::vector<Tensor> masks = images_of(seen, &View::mask);
        if (animation) std::ranges::transform(masks, masks.begin(), grey);
        write(beside(animation ? "_mask" + out.extension().string() : "_mask.png"), masks);
    }
    if (options.renderer.depth && animation) {
        for (std::size_t i = 0; i < seen.size(); ++i)
            write_exr(beside("_" + numbered(i) + "_depth.exr"), seen[i].depth);
    } else if (options.renderer.depth) {
        write_exr(beside("_depth.exr"), tile_images(images_of(seen, &View::depth), list.columns));
    }
    return result;
}

namespace {

constexpr std::int64_t most_statistics_faces = 1000;

CodeStatistics statistics_of(const RenderOptions& options, const Model& model) {
    if (options.data.empty()) {
        if (model.code_statistics()) return *model.code_statistics();
        fail<FileError>(
            model_file(options.model).string(),
            ": has no statistics of codes to draw faces from; name a folder of faces with --data");
    }
    const Dataset faces(options.data, model.config().decoder.resolution, {.cache_megabytes = 0},
                        Split::all, model.config().camera);
    const std::optional<CodeStatistics> statistics =
        code_statistics_of(model, faces, most_statistics_faces);
    write_left_out(std::cerr, faces.summary().left_out);
    write_broken_files(std::cerr, faces.summary(), 0);
    if (!statistics)
        fail<FileError>(options.data.string(), ": statistics of codes need two faces or more");
    return *statistics;
}

}  // namespace

WrittenImages write_new_faces(const RenderOptions& options, const Model& model,
                              std::uint64_t seed) {
    const CodeStatistics statistics = statistics_of(options, model);
    const Pose pose = chosen_pose(options, model, frontal_pose(model.config().camera));
    Rng unused(0);
    const Codes rest = options.codes.empty() ? statistics.sample(unused, 0.0)
                                             : read_own_codes(options.codes, options.model).codes;
    ShotList list;
    for (int i = 0; i < options.sample; ++i) {
        const Codes face =
            statistics.new_face(seed, static_cast<std::uint64_t>(i), options.truncation);
        list.shots.push_back({interpolated(rest, face, 1.0, options.take), pose});
    }
    list.columns = static_cast<int>(std::ceil(std::sqrt(static_cast<double>(options.sample))));
    const std::string mark = model_mark(options.model);
    FolderInProgress folder(options.out);
    WrittenImages result = write_images(folder.path() / "faces.png", options, model, list);
    std::vector<std::filesystem::path>& written = result.files;
    for (std::size_t i = 0; i < list.shots.size(); ++i) {
        written.push_back(folder.path() / (numbered(i) + ".json"));
        write_code_file(written.back(), list.shots[i].codes, 0, pose, mark);
    }
    folder.finish();
    for (std::filesystem::path& path : written) path = options.out / path.filename();
    return result;
}

}  // namespace stymo
