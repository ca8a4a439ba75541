#include <iomanip>
#include <iostream>
#include <sstream>

#include "apps/common/output_file.h"
#include "apps/landmarks/commands.h"
#include "core/clock.h"
#include "core/error.h"
#include "core/interrupt.h"
#include "core/io/image.h"
#include "core/parallel.h"
#include "core/progress.h"
#include "fit/photo/face_detector.h"
#include "render/morphable/head_source.h"
#include "train/data/folder_scan.h"
#include "train/landmarks/photo_landmarks.h"
#include "train/landmarks/photo_variation.h"

namespace stymo::landmarks {
namespace {

namespace fs = std::filesystem;

/// Larger photos are of no use to a network that sees 80 x 80 pixels.
constexpr double longest_side = 640.0;
constexpr double longest_side_of_background = 160.0;

[[nodiscard]] Tensor shrunk(const Tensor& photo, double longest) {
    const auto height = static_cast<double>(photo.shape(0));
    const auto width = static_cast<double>(photo.shape(1));
    const double scale = longest / std::max(height, width);
    if (scale >= 1.0) return photo;
    return resize_image(photo, std::max(1, static_cast<int>(scale * height)),
                        std::max(1, static_cast<int>(scale * width)));
}

/// The first photos of a folder in the order of their ids.
std::vector<Tensor> read_photos(const TrainOptions& options, double longest) {
    if (options.photos.empty()) return {};
    std::vector<FaceFiles> files = scan_folder(options.photos).faces;
    if (options.photo_count > 0 && options.photo_count < std::ssize(files))
        files.resize(static_cast<std::size_t>(options.photo_count));
    std::vector<Tensor> photos(files.size());
    parallel_for(std::ssize(files), 1, [&](std::int64_t begin, std::int64_t end) {
        for (std::int64_t k = begin; k < end; ++k) {
            const auto at = static_cast<std::size_t>(k);
            photos[at] = shrunk(read_image(files[at].image), longest);
        }
    });
    return photos;
}

/// A sheet of training examples with their points, for inspection.
void write_sheet(const fs::path& path, const std::vector<LandmarkExample>& examples,
                 const std::vector<Tensor>& backgrounds, const Rng& rng) {
    constexpr std::int64_t side = 160;
    std::vector<Tensor> images;
    for (std::size_t k = 0; k < examples.size(); ++k) {
        LandmarkTarget target = varied(examples[k], backgrounds, side, rng.split(k));
        const auto values = target.image.mutable_values<float>();
        for (const Eigen::Vector2d& point : target.points) {
            const auto column = std::llround(0.5 * side * (point.x() + 1.0) - 0.5);
            const auto row = std::llround(0.5 * side * (point.y() + 1.0) - 0.5);
            if (row < 0 || row >= side || column < 0 || column >= side) continue;
            const auto at = static_cast<std::size_t>(3 * (row * side + column));
            values[at] = 0.1F;
            values[at + 1] = 1.0F;
            values[at + 2] = 0.1F;
        }
        images.push_back(std::move(target.image));
    }
    write_image(path, tile_images(images, 8));
}

void declare_training(Command& command, TrainOptions& options) {
    command.option(
        "--morphable", options.morphable,
        "head that is rendered: a .safetensors file or a folder of ICT-FaceKit (default: "
        "the built-in head)");
    command.option("--out", options.out, "the network, a .safetensors file").required();
    command.option("--count", options.photo_count,
                   "only so many photos, the first ones in the order of their names; 0: all");
    command.option("--sheet", options.sheet,
                   "only writes an image (.png) of examples that would be learnt from");
    command.option("--steps", options.settings.steps, "steps of training").range(0, 1e7);
    command.option("--batch", options.settings.batch, "faces in a step").range(1, 4096);
    command.option("--rate", options.settings.learning_rate, "learning rate at the start")
        .range(0.0, 1.0);
    command.option("--heads", options.settings.heads, "rendered heads held in memory")
        .range(1, 100000);
    command.option("--new-heads", options.settings.new_heads, "of them, new in each step")
        .range(0, 1000);
}

/// Trains, and returns the mean loss of the last tenth of the steps.
double run_training(LandmarkModel& model, const HeadPictures& pictures,
                    const std::vector<Tensor>& backgrounds,
                    const std::vector<LandmarkExample>& photos,
                    const LandmarkTrainingSettings& settings, const Rng& rng,
                    const std::string& title) {
    Progress progress({title, settings.steps, 0, "steps"});
    double recent = 0.0, last = 0.0;
    std::int64_t lasting = 0;
    train_landmarks(
        model, pictures, backgrounds, photos, settings, rng, [&](std::int64_t step, double loss) {
            recent = step == 1 ? loss : 0.98 * recent + 0.02 * loss;
            if (step > settings.steps - std::max<std::int64_t>(1, settings.steps / 10)) {
                last += loss;
                ++lasting;
            }
            std::ostringstream text;
            text << "loss " << std::fixed << std::setprecision(4) << recent;
            progress.update(step, text.str());
        });
    progress.finish();
    return lasting > 0 ? last / static_cast<double>(lasting) : 0.0;
}

AppResult result_of(const TrainOptions& options, double loss, std::int64_t photos, double start) {
    const double seconds = seconds_now() - start;
    std::ostringstream text;
    text << options.out.string() << ": loss " << loss << " in " << duration_text(seconds) << "\n";
    return {text.str(), JsonValue::object({{"written", options.out.string()},
                                           {"loss", loss},
                                           {"photos", photos},
                                           {"seconds", seconds}})};
}

AppResult train(const TrainOptions& options, const CommonOptions& common) {
    const double start = seconds_now();
    require_extension(options.out, {".safetensors"});
    require_folder_of(options.out);
    const MorphableHead head = morphable_head_from(options.morphable);
    const HeadPictures pictures(head);
    const std::vector<Tensor> backgrounds = read_photos(options, longest_side_of_background);
    const Rng rng(common.seed);
    if (!options.sheet.empty()) {
        std::vector<LandmarkExample> examples;
        for (std::uint64_t k = 0; k < 32; ++k)
            examples.push_back(pictures.draw(rng.split("sheet").split(k)));
        write_sheet(options.sheet, examples, backgrounds, rng.split("sheet"));
        return {options.sheet.string() + "\n",
                JsonValue::object({{"written", options.sheet.string()}})};
    }
    const InterruptGuard guard;
    LandmarkModel model = options.initial_model ? read_landmark_model(*options.initial_model)
                                                : make_landmark_model(rng.split("weights"));
    const double loss = run_training(model, pictures, backgrounds, {}, options.settings,
                                     rng.split("training"), "Training");
    write_landmark_model(options.out, model);
    return result_of(options, loss, 0, start);
}

/// The photos' largest faces with the landmarks that the network itself finds.
std::vector<LandmarkExample> label(const std::vector<Tensor>& photos, const LandmarkModel& model,
                                   const std::vector<FaceSquare>& squares, const Rng& rng) {
    std::vector<std::optional<LandmarkExample>> found(photos.size());
    parallel_for(std::ssize(photos), 1, [&](std::int64_t begin, std::int64_t end) {
        for (std::int64_t k = begin; k < end; ++k) {
            const auto at = static_cast<std::size_t>(k);
            if (interrupted() || squares[at].axis.isZero()) continue;
            found[at] =
                example_of_photo(model, photos[at], find_points(model, photos[at], squares[at]),
                                 rng.split(static_cast<std::uint64_t>(k)));
        }
    });
    if (interrupted()) fail<Error>("interrupted; nothing was written");
    std::vector<LandmarkExample> examples;
    for (std::optional<LandmarkExample>& example : found)
        if (example) examples.push_back(std::move(*example));
    if (examples.empty()) fail<ValueError>("no face was found in the photos");
    return examples;
}

/// The squares of the largest faces; a square without extent where no face is found.
std::vector<FaceSquare> squares_of_faces(const std::vector<Tensor>& photos,
                                         const FaceDetector& detector) {
    std::vector<FaceSquare> squares(photos.size(), FaceSquare{{0.0, 0.0}, {0.0, 0.0}});
    parallel_for(std::ssize(photos), 1, [&](std::int64_t begin, std::int64_t end) {
        for (std::int64_t k = begin; k < end; ++k) {
            const auto at = static_cast<std::size_t>(k);
            if (interrupted()) return;
            const std::vector<DetectedFace> faces = detector.find(photos[at]);
            if (faces.empty()) continue;
            const DetectedFace& face = faces.front();
            squares[at] = square_of_box(face.left, face.top, face.width, face.height);
        }
    });
    return squares;
}

AppResult adapt(const AdaptOptions& options, const CommonOptions& common) {
    const double start = seconds_now();
    const TrainOptions& train = options.train;
    require_extension(train.out, {".safetensors"});
    require_folder_of(train.out);
    LandmarkModel model = read_landmark_model(options.model);
    const FaceDetector detector(options.model);
    const MorphableHead head = morphable_head_from(train.morphable);
    const HeadPictures pictures(head);
    const InterruptGuard guard;
    const std::vector<Tensor> photos = read_photos(train, longest_side);
    std::vector<Tensor> backgrounds;
    for (const Tensor& photo : photos)
        backgrounds.push_back(shrunk(photo, longest_side_of_background));
    const std::vector<FaceSquare> squares = squares_of_faces(photos, detector);
    const Rng rng(common.seed);
    double loss = 0.0;
    std::int64_t used = 0;
    for (std::int64_t round = 1; round <= options.rounds; ++round) {
        const Rng draws = rng.split("round").split(static_cast<std::uint64_t>(round));
        const std::vector<LandmarkExample> examples =
            label(photos, model, squares, draws.split("labels"));
        used = std::ssize(examples);
        std::cerr << "Round " << round << ": " << used << " of " << photos.size()
                  << " photos have landmarks\n";
        if (!train.sheet.empty()) {
            write_sheet(train.sheet,
                        {examples.begin(), examples.begin() + std::min<std::ptrdiff_t>(32, used)},
                        photos, draws);
            return {train.sheet.string() + "\n",
                    JsonValue::object({{"written", train.sheet.string()}})};
        }
        loss = run_training(model, pictures, backgrounds, examples, train.settings,
                            draws.split("training"), "Round " + std::to_string(round));
    }
    write_landmark_model(train.out, model);
    return result_of(train, loss, used, start);
}

}  // namespace

void declare_train(CommandLine& line, TrainOptions& options) {
    Command command =
        line.command("train", "Trains a network on renderings of a linear head.",
                     [&](const CommonOptions& common) { return train(options, common); });
    command.option("--initial-model", options.initial_model,
                   "a network to begin with (default: random weights)");
    command.option("--photos", options.photos,
                   "folder of photos whose parts are backgrounds (default: drawn ones)");
    declare_training(command, options);
}

void declare_adapt(CommandLine& line, AdaptOptions& options) {
    Command command =
        line.command("adapt", "Trains a network on, with photos whose landmarks it finds itself.",
                     [&](const CommonOptions& common) { return adapt(options, common); });
    options.train.settings.steps = 3000;
    options.train.settings.learning_rate = 5e-4;
    command.option("--model", options.model, "the network to begin with").required();
    command.option("--photos", options.train.photos, "folder of photos").required();
    command.option("--rounds", options.rounds, "how often the photos are labelled").range(1, 100);
    declare_training(command, options.train);
}

}  // namespace stymo::landmarks
