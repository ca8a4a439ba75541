#include "apps/render/images.h"

#include <algorithm>
#include <iomanip>
#include <iostream>
#include <sstream>

#include "core/error.h"
#include "core/interrupt.h"
#include "core/io/image.h"
#include "core/progress.h"
#include "nn/realtime/chosen_tolerance.h"

namespace stymo {

namespace {

/// Those of the command line, with the tolerance that --psnr asks for.
RendererOptions chosen_options(const RenderOptions& options, const Model& model,
                               const std::vector<Shot>& shots) {
    RendererOptions chosen = options.renderer;
    chosen.remove_floaters = !options.keep_floaters;
    if (!options.psnr) return chosen;
    constexpr std::size_t most_cameras = 5;
    std::vector<Camera> cameras;
    const std::size_t count = std::min(most_cameras, shots.size());
    for (std::size_t i = 0; i < count; ++i)
        cameras.push_back(camera_from_pose(shots[i * shots.size() / count].pose,
                                           model.config().camera.intrinsics));
    const ChosenTolerance found =
        choose_tolerance(model, shots.front().codes, cameras, chosen, *options.psnr);
    chosen.tolerance = found.tolerance;
    std::cerr << std::setprecision(3) << "tolerance " << found.tolerance << ": "
              << found.error.mean_psnr << " dB on average, " << found.error.worst_psnr
              << " at worst over " << count << " views" << std::endl;
    return chosen;
}

std::vector<View> views(const RenderOptions& options, const Model& model,
                        const std::vector<Shot>& shots, Explainer& explainer) {
    FaceRenderer renderer(model, chosen_options(options, model, shots));
    std::vector<View> result;
    const InterruptGuard guard;
    std::optional<Progress> progress;
    if (shots.size() > 1)
        progress.emplace(ProgressTask{
            .title = "render", .total = static_cast<std::int64_t>(shots.size()), .unit = "frames"});
    for (const Shot& shot : shots) {
        if (interrupted()) fail<Error>("interrupted; nothing was written");
        renderer.show(shot.codes);
        result.push_back(
            renderer.render(camera_from_pose(shot.pose, model.config().camera.intrinsics)));
        if (progress) progress->update(static_cast<std::int64_t>(result.size()));
    }
    if (progress) progress->finish();
    explainer.count(renderer.counts());
    return result;
}

std::vector<Tensor> images_of(const std::vector<View>& views, Tensor View::*part) {
    std::vector<Tensor> images;
    for (const View& view : views) images.push_back(view.*part);
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

std::string numbered(std::size_t frame) {
    std::ostringstream text;
    text << '_' << std::setw(4) << std::setfill('0') << frame;
    return text.str();
}

}  // namespace

std::vector<std::filesystem::path> write_images(const std::filesystem::path& out,
                                                const RenderOptions& options, const Model& model,
                                                const ShotList& list, Explainer& explainer) {
    const std::vector<View> seen = views(options, model, list.shots, explainer);
    const bool animation = out.extension() == ".gif" || out.extension() == ".mp4";
    std::vector<std::filesystem::path> written;
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
    write(written.emplace_back(out), images_of(seen, &View::image));
    if (options.renderer.mask) {
        std::vector<Tensor> masks = images_of(seen, &View::mask);
        if (animation) std::ranges::transform(masks, masks.begin(), grey);
        write(beside(animation ? "_mask" + out.extension().string() : "_mask.png"), masks);
    }
    if (options.renderer.depth && animation) {
        for (std::size_t i = 0; i < seen.size(); ++i)
            write_exr(beside(numbered(i) + "_depth.exr"), seen[i].depth);
    } else if (options.renderer.depth) {
        write_exr(beside("_depth.exr"), tile_images(images_of(seen, &View::depth), list.columns));
    }
    return written;
}

}  // namespace stymo
