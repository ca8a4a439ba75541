#include "apps/prep/pipeline.h"

#include <algorithm>
#include <set>
#include <span>

#include "apps/prep/completion.h"
#include "apps/prep/progress_file.h"
#include "core/error.h"
#include "core/interrupt.h"
#include "core/io/file.h"
#include "core/io/image.h"
#include "core/io/mask_file.h"
#include "core/ops/elementwise.h"
#include "core/parallel.h"
#include "train/data/folder_scan.h"

namespace stymo {
namespace {

namespace fs = std::filesystem;

/// Photos that are fitted at once: enough for all threads, and few enough that Ctrl-C takes effect
/// soon.
std::size_t photos_in_a_batch() {
    return static_cast<std::size_t>(4 * thread_count());
}

void require_own_folder(const fs::path& folder) {
    if (fs::exists(folder) && !fs::exists(ProgressFile::path_in(folder)) &&
        (!fs::is_directory(folder) || !fs::is_empty(folder)))
        fail<FileError>(folder.string(), ": exists already; choose another folder or remove it");
}

JsonValue settings_json(const fs::path& photos, const PhotoPreparationSettings& settings) {
    const auto absolute = [](const fs::path& path) {
        return path.empty() ? std::string() : fs::absolute(path).string();
    };
    return JsonValue::object({{"--photos", absolute(photos)},
                              {"--size", settings.side},
                              {"--max-pixels", settings.most_pixels},
                              {"--all-faces", settings.all_faces},
                              {"--new-masks", settings.new_masks},
                              {"--whole-head", settings.whole_head},
                              {"--focal", settings.intrinsics.focal},
                              {"--landmarks", absolute(settings.landmark_model)},
                              {"--morphable", absolute(settings.morphable)},
                              {"--mask-net", absolute(settings.mask_network)},
                              {"--pose-net", absolute(settings.pose_network)},
                              {"--distance", settings.pivot.distance},
                              {"--pivot-depth", settings.pivot.pivot_depth}});
}

bool has_landmarks(const FolderScan& scan, const std::string& id) {
    const FaceEntry* entry = scan.records.find(id);
    return entry != nullptr && entry->has_landmarks;
}

KnownOfPhoto known_of(const std::string& id, const FolderScan& scan, const FaceImage& image) {
    KnownOfPhoto known{image.mask, {}, image.known};
    if (has_landmarks(scan, id))
        std::ranges::copy(scan.records.read(id).landmarks, known.landmarks.emplace().begin());
    return known;
}

/// A photo in preparation, with its crops until they are fitted.
struct PhotoInWork {
    const FaceFiles* files = nullptr;
    std::vector<FaceCrop> crops;
    std::string failure;
    std::string doubt;  ///< about its colours
    bool scaled_mask = false;
};

PhotoInWork cropped(const FaceFiles& files, const FolderScan& scan,
                    const PhotoPreparation& preparation) {
    PhotoInWork work{&files, {}, {}, {}, false};
    FaceImage image = read_face_image(files, preparation.settings().most_pixels);
    if (image.broken) {
        const bool of_photo = image.broken->file == files.image.string();
        work.failure =
            of_photo ? image.broken->reason : image.broken->file + ": " + image.broken->reason;
        return work;
    }
    work.doubt = std::move(image.doubt);
    work.scaled_mask = image.scaled_mask;
    try {
        work.crops = preparation.crops(image.image, known_of(files.id, scan, image));
    } catch (const Error& error) {
        work.failure = error.what();
    }
    return work;
}

/// "ID" for the largest face of a photo, "ID_2" for the next.
std::string face_id(const std::string& photo, std::size_t index) {
    return index == 0 ? photo : photo + "_" + std::to_string(index + 1);
}

/// Writes the results of a photo, images first, so that the images of every recorded photo exist.
/// `known` is the line of the photo, whose person is its largest face; or null.
PhotoOutcome written(const FolderPreparation& folders, PhotoInWork work,
                     std::span<PreparedFace> faces, const std::set<std::string>& photo_ids,
                     const FaceEntry* known) {
    PhotoOutcome outcome{
        work.files->image.lexically_relative(folders.photos).string(), std::move(work.failure), {}};
    for (std::size_t i = 0; i < faces.size(); ++i) {
        std::string id = face_id(work.files->id, i);
        if (i > 0 && photo_ids.contains(id))
            faces[i].failure = "a photo has the id " + id + " of its face " + std::to_string(i + 1);
        if (!faces[i].failure.empty()) {
            outcome.failure = faces[i].failure;
            continue;
        }
        if (!work.doubt.empty()) faces[i].warnings.push_back(work.doubt);
        if (work.scaled_mask)
            faces[i].warnings.push_back(std::string("its mask has ") + scaled_mask_note);
        const auto write = [&](const char* kind, const Tensor& pixels) {
            const fs::path file = folders.out / kind / (id + ".png");
            require_writable_folder(file.parent_path());
            write_image(file, pixels, Durability::crash_safe);
        };
        write("images", faces[i].crop.image);
        write("masks", faces[i].crop.mask);
        if (faces[i].crop.known.defined())
            write("unknown", affine(faces[i].crop.known, -1.0, 1.0).value());
        outcome.faces.push_back(outcome_of(std::move(id), std::move(faces[i])));
        if (i > 0 || known == nullptr) continue;
        outcome.faces.back().origin = known->origin;
    }
    return outcome;
}

class FolderWork {
public:
    FolderWork(const FolderPreparation& folders, const PhotoPreparation& preparation,
               const FolderScan& scan)
        : folders_(folders),
          preparation_(preparation),
          scan_(scan),
          notes_(folders.out, settings_json(folders.photos, preparation.settings())) {
        for (const FaceFiles& files : scan.faces) {
            photo_ids_.insert(files.id);
            if (!notes_.contains(name_of(files))) waiting_.push_back(&files);
        }
    }

    [[nodiscard]] std::int64_t waiting() const { return std::ssize(waiting_); }
    [[nodiscard]] const ProgressFile& notes() const { return notes_; }

    /// Prepares up to a batch of the remaining photos. Returns false, and records none of them, if
    /// a signal arrived.
    [[nodiscard]] bool next_batch() {
        const std::size_t count = std::min(photos_in_a_batch(), waiting_.size());
        std::vector<PhotoInWork> batch(count);
        parallel_items(std::ssize(batch), [&](std::size_t i, int /*thread*/) {
            if (!interrupted()) batch[i] = cropped(*waiting_[i], scan_, preparation_);
        });
        if (interrupted()) return false;
        std::vector<FaceCrop> crops;
        std::vector<std::size_t> first_face;
        for (PhotoInWork& photo : batch) {
            first_face.push_back(crops.size());
            std::ranges::move(photo.crops, std::back_inserter(crops));
        }
        first_face.push_back(crops.size());
        std::vector<PreparedFace> faces = preparation_.finish(std::move(crops));
        std::vector<PhotoOutcome> outcomes(count);
        parallel_items(std::ssize(outcomes), [&](std::size_t i, int /*thread*/) {
            outcomes[i] =
                written(folders_, std::move(batch[i]),
                        std::span(faces).subspan(first_face[i], first_face[i + 1] - first_face[i]),
                        photo_ids_, scan_.records.find(batch[i].files->id));
        });
        for (const PhotoOutcome& outcome : outcomes) notes_.append(outcome);
        waiting_.erase(waiting_.begin(), waiting_.begin() + static_cast<std::ptrdiff_t>(count));
        return true;
    }

    /// Files of the photos that are noted.
    [[nodiscard]] std::vector<std::string> done() const {
        std::vector<std::string> names;
        for (const FaceFiles& files : scan_.faces)
            if (notes_.contains(name_of(files))) names.push_back(name_of(files));
        return names;
    }
    /// Ids of all photos, including those from which the folder of photos was itself prepared.
    [[nodiscard]] std::vector<std::string> photo_ids() const {
        if (!scan_.photo_ids.empty()) return scan_.photo_ids;
        std::vector<std::string> ids;
        for (const FaceFiles& files : scan_.faces) ids.push_back(files.id);
        return ids;
    }

private:
    [[nodiscard]] std::string name_of(const FaceFiles& files) const {
        return files.image.lexically_relative(folders_.photos).string();
    }

    const FolderPreparation& folders_;
    const PhotoPreparation& preparation_;
    const FolderScan& scan_;
    ProgressFile notes_;
    std::set<std::string> photo_ids_;
    std::vector<const FaceFiles*> waiting_;
};

}  // namespace

PrepareOutcome prepare_folder(const FolderPreparation& folders, const PhotoPreparation& preparation,
                              const std::function<void(std::int64_t, std::int64_t)>& progress) {
    const FolderScan scan = scan_folder(folders.photos);
    require_own_folder(folders.out);
    // Before anything is written.
    if (!std::ranges::all_of(scan.faces,
                             [&](const FaceFiles& files) { return has_landmarks(scan, files.id); }))
        preparation.detector();
    require_writable_folder(folders.out);

    PrepareOutcome outcome;
    outcome.found = std::ssize(scan.faces);
    FolderWork work(folders, preparation, scan);
    require_writable_folder(folders.out / "images");
    require_writable_folder(folders.out / "masks");
    remove_temporary_files(folders.out);
    for (const auto& entry : fs::recursive_directory_iterator(folders.out))
        if (entry.is_directory()) remove_temporary_files(entry.path());
    const std::int64_t before = outcome.found - work.waiting();
    bool going_on = true;
    do {
        outcome.done = outcome.found - work.waiting();
        if (progress) progress(outcome.done, outcome.found);
        going_on = work.waiting() > 0 && work.next_batch();
    } while (going_on);
    outcome.done_now = outcome.done - before;
    const bool complete = work.waiting() == 0;
    std::optional<PrepareReport> report = write_data_set(
        folders, preparation, work.done(), work.photo_ids(), scan.left_out, work.notes(), complete);
    if (complete) outcome.report = std::move(report);
    return outcome;
}

}  // namespace stymo
