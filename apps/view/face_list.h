#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "nn/models/code_file.h"
#include "nn/models/model.h"
#include "nn/realtime/face_renderer.h"

namespace stymo::view {

/// One face of a viewer.
struct ListedFace {
    std::string name;
    CodeFile face;
    /// The tuned model if the face is tuned, else the common one.
    std::shared_ptr<const Model> model;
    bool tuned = false;
    /// The tolerance that the last film of this face chose, and from which the next one starts.
    std::shared_ptr<std::atomic<double>> tolerance =
        std::make_shared<std::atomic<double>>(default_tolerance);
};

/// Counts the tuned models that exist in all sessions. Thread-safe.
class TunedModels {
public:
    explicit TunedModels(std::size_t most = 64) : most_(most) {}
    /// Counts a model until it is released. A model is counted once. Throws ValueError if there are
    /// too many.
    void count(const std::shared_ptr<const Model>& model);
    /// Throws ValueError if `count` would for a further model.
    void require_room();

private:
    void require_room_locked();

    std::size_t most_;
    std::mutex mutex_;
    std::vector<std::weak_ptr<const Model>> models_;
};

/// The faces that one viewer can show and mix: at most 64. Thread-safe.
///
/// A tuned model holds a decoder of its own, which mixed faces share. A list has at most 16 tuned
/// models, and all lists have at most as many as `TunedModels` allows. So the faces of all
/// sessions take no more memory than 64 decoders, besides the common model.
class FaceList {
public:
    static constexpr std::size_t most_faces = 64;

    explicit FaceList(TunedModels& all) : all_(all) {}
    /// Adds a face and returns its id. Throws ValueError if there is no room for the face or its
    /// model.
    [[nodiscard]] std::string add(ListedFace face);
    /// Throws ValueError for an unknown id.
    [[nodiscard]] ListedFace find(const std::string& id) const;
    /// Replaces a face, for example during its fit; false if it was removed. Throws ValueError if
    /// there is no room for the new model; then the old face stays.
    [[nodiscard]] bool replace(const std::string& id, ListedFace face);
    /// Throws ValueError if there is no room for a further tuned model.
    void require_room_for_tuned() const;
    void remove(const std::string& id);
    /// All pairs (id, face) in the order in which they were added.
    [[nodiscard]] std::vector<std::pair<std::string, ListedFace>> all() const;

private:
    /// `except`: the id of a face that does not count.
    void count_model(const ListedFace& face, const std::string& except = {}) const;

    TunedModels& all_;
    mutable std::mutex mutex_;
    std::uint64_t count_ = 0;
    std::vector<std::pair<std::string, ListedFace>> faces_;
};

/// Codes in Z as hexadecimal digits, four for each of the 306 elements (float16): short enough for
/// the address of a page.
[[nodiscard]] std::string text_of_codes(const Codes& codes);
/// The inverse. Throws ValueError for a text of another length, characters that are not hexadecimal
/// digits, or numbers that are not finite.
[[nodiscard]] Codes codes_of_text(const std::string& text);

}  // namespace stymo::view
