#include "apps/prep/pipeline.h"

#include <algorithm>
#include <iterator>

#include "apps/prep/photo_outcome.h"
#include "core/error.h"
#include "core/interrupt.h"
#include "core/io/file.h"
#include "core/io/image.h"
#include "core/io/mask_file.h"
#include "core/ops/elementwise.h"
#include "core/parallel.h"
#include "core/progress.h"
#include "train/data/face_image.h"

namespace stymo {
namespace {

namespace fs = std::filesystem;

/// Photos that are fitted at once: enough for all threads, and few enough that Ctrl-C takes effect
/// soon.
std::size_t photos_in_a_batch() {
    return static_cast<std::size_t>(4 * thread_count());
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

/// "ID" for the clearest face of a photo, "ID_2" for the next.
std::string face_id(const std::string& photo, std::size_t index) {
    return index == 0 ? photo : photo + "_" + std::to_string(index + 1);
}

/// Writes the results of a photo, images first, so that the images of every recorded photo exist.
/// `known` is the line of the photo, whose person is its clearest face; or null.
PhotoOutcome written(const FolderPreparation& folders, PhotoInWork work,
                     std::span<PreparedFace> faces, const std::set<std::string>& photo_ids,
                     const FaceEntry* known) {
    PhotoOutcome outcome{
        work.files->image.lexically_relative(folders.photos).string(), std::move(work.failure), {}};
    std::string failure;
    std::vector<std::string> lost;
    for (std::size_t i = 0; i < faces.size(); ++i) {
        std::string id = face_id(work.files->id, i);
        if (i > 0 && photo_ids.contains(id))
            faces[i].failure = "a photo has the id " + id + " of its face " + std::to_string(i + 1);
        if (!faces[i].failure.empty()) {
            failure = faces[i].failure;
            lost.push_back("face " + std::to_string(i + 1) + ": " + failure);
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
    if (outcome.failure.empty() && outcome.faces.empty()) outcome.failure = std::move(failure);
    if (!outcome.faces.empty())
        std::ranges::move(lost, std::back_inserter(outcome.faces.front().warnings));
    return outcome;
}

}  // namespace

PreparationRun::PreparationRun(FolderPreparation folders, const PhotoPreparation& preparation,
                               const Settings& settings, Ranks& ranks)
    : folders_(std::move(folders)),
      preparation_(preparation),
      ranks_(ranks),
      scan_((ResultFolder::require_apart(folders_.out, folders_.photos),
             ResultFolder::require_own(folders_.out), scan_folder(folders_.photos))),
      results_(folders_.out, settings, "progress", "file", ranks) {
    for (const FaceFiles& files : scan_.faces) {
        // Finds out whether there is a detector.
        if (!has_landmarks(scan_, files.id)) preparation_.detector();
        photo_ids_.insert(files.id);
        names_.push_back(files.image.lexically_relative(folders_.photos).string());
        if (!results_.contains(names_.back())) waiting_.push_back(&files);
    }
}

bool PreparationRun::prepare_batch(std::span<const FaceFiles* const> photos) {
    std::vector<PhotoInWork> batch(photos.size());
    parallel_items(std::ssize(batch), [&](std::size_t i, int /*thread*/) {
        if (!interrupted()) batch[i] = cropped(*photos[i], scan_, preparation_);
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
    std::vector<PhotoOutcome> outcomes(batch.size());
    parallel_items(std::ssize(outcomes), [&](std::size_t i, int /*thread*/) {
        outcomes[i] =
            written(folders_, std::move(batch[i]),
                    std::span(faces).subspan(first_face[i], first_face[i + 1] - first_face[i]),
                    photo_ids_, scan_.records.find(photos[i]->id));
    });
    for (const PhotoOutcome& outcome : outcomes) results_.append(to_json(outcome));
    return true;
}

void PreparationRun::prepare_share() {
    results_.begin();
    const std::vector<const FaceFiles*> share = share_of(ranks_, waiting_);
    const std::int64_t before = std::ssize(names_) - std::ssize(waiting_);
    Progress progress({"Photos", before + std::ssize(share), before, "photos"});
    std::span<const FaceFiles* const> rest = share;
    do {
        progress.update(before + std::ssize(share) - std::ssize(rest));
        const std::size_t count = std::min(photos_in_a_batch(), rest.size());
        if (count == 0 || !prepare_batch(rest.first(count))) break;
        rest = rest.subspan(count);
    } while (true);
    // Waits for the other ranks.
    static_cast<void>(any(ranks_, false));
}

void PreparationRun::follow() {
    const InterruptGuard guard;
    prepare_share();
}

void PreparationRun::remove_faces_without_photo(const std::set<std::string>& ids) const {
    for (const std::string& id : ids)
        for (const char* kind : {"images", "masks", "unknown"})
            fs::remove(folders_.out / kind / (id + ".png"));
}

std::set<std::string> PreparationRun::face_ids(std::span<const std::string> photos) const {
    std::set<std::string> ids;
    for (const std::string& photo : photos)
        for (const FaceOutcome& face : results_.read(photo, parse_photo_outcome).faces)
            ids.insert(face.id);
    return ids;
}

PrepareOutcome PreparationRun::lead() {
    const InterruptGuard guard;
    prepare_share();
    std::set<std::string> gone = face_ids(results_.photos());
    results_.join(names_);
    std::vector<std::string> done;
    std::ranges::copy_if(names_, std::back_inserter(done),
                         [&](const std::string& name) { return results_.contains(name); });
    for (const std::string& id : face_ids(done)) gone.erase(id);
    remove_faces_without_photo(gone);
    // Those from which the folder of photos was itself prepared, if it was.
    std::vector<std::string> photo_ids = scan_.photo_ids;
    if (photo_ids.empty())
        for (const FaceFiles& files : scan_.faces) photo_ids.push_back(files.id);
    PrepareOutcome outcome;
    outcome.done = std::ssize(done);
    outcome.found = std::ssize(names_);
    outcome.done_now = outcome.done - (outcome.found - std::ssize(waiting_));
    const bool complete = outcome.done == outcome.found;
    std::optional<PrepareReport> report =
        write_data_set(folders_, preparation_, done, photo_ids, scan_.left_out, results_, complete);
    if (complete) outcome.report = std::move(report);
    return outcome;
}

}  // namespace stymo
