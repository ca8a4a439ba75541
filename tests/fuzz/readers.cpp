#include "fuzz/readers.h"

#include "apps/eval/score.h"
#include "apps/prep/photo_outcome.h"
#include "apps/view/request.h"
#include "core/config.h"
#include "core/error.h"
#include "core/io/checksum.h"
#include "core/io/onnx_file.h"
#include "core/io/tensor_file.h"
#include "core/io/torch_file.h"
#include "fit/photo/marked_points.h"
#include "fuzz/scratch_file.h"
#include "nn/models/code_file.h"
#include "nn/models/weight_changes.h"
#include "render/camera_file.h"
#include "render/morphable/head_file.h"
#include "render/morphable/obj_head.h"
#include "support/tiny_model.h"
#include "train/data/face_index.h"
#include "train/data/face_records.h"
#include "train/data/folder_records.h"
#include "train/train_config.h"

namespace stymo::fuzz {

namespace {

/// Calls each, though the one before may have refused the bytes; then throws its refusal.
template <class First, class... Rest>
void each(const First& first, const Rest&... rest) {
    if constexpr (sizeof...(rest) == 0) {
        first();
    } else {
        try {
            first();
        } catch (const Error&) {
            each(rest...);
            throw;
        }
        each(rest...);
    }
}

void read_configuration(const std::string& bytes) {
    // Made once: describing all keys takes longer than reading most inputs.
    static TrainConfig config;
    static ConfigSchema schema = [] {
        ConfigSchema made;
        describe(made, config);
        return made;
    }();
    each([&] { schema.read_text(bytes, "fuzzed"); }, [&] { schema.set(bytes); },
         [&] { schema.set("loss.code_weights=" + bytes); });
}

/// The bytes are one file of a folder that is complete otherwise.
void read_obj_folder(const std::string& name, const std::string& bytes) {
    static const bool complete = [] {
        std::string mesh, landmarks;
        for (int k = 0; k < 70; ++k) {
            const bool mouth = k >= 48 && k < 68;
            mesh += "v " + std::to_string(k % 7 - 3) + (mouth ? " -4 8\n" : " 3 8\n");
            if (k < 68) landmarks += (k > 0 ? "," : "") + std::to_string(k);
        }
        for (const char* file : {"generic_neutral_mesh.obj", "identity000.obj", "jawOpen.obj"})
            static_cast<void>(scratch_file(file, mesh + "f 1 2 37 4\n"));
        static_cast<void>(scratch_file(
            "whole.json",
            R"({"expressions": ["jawOpen"], "idx_to_landmark_verts": [)" + landmarks + "]}"));
        return true;
    }();
    static_cast<void>(complete);
    if (name != "vertex_indices.json")
        std::filesystem::copy_file(scratch_folder() / "whole.json",
                                   scratch_folder() / "vertex_indices.json",
                                   std::filesystem::copy_options::overwrite_existing);
    static_cast<void>(scratch_file(name, bytes));
    static_cast<void>(read_obj_head(scratch_folder()));
}

void read_request(const std::string& bytes) {
    const CameraConfig camera;
    each([&] { static_cast<void>(view::frame_wish(bytes, camera)); },
         [&] { static_cast<void>(view::color_wish(bytes, camera)); },
         [&] { static_cast<void>(view::face_wish(bytes)); },
         [&] { static_cast<void>(view::path_wish(bytes, camera)); },
         [&] {
             static_cast<void>(
                 view::Request{.path = {}, .query = {{"x", bytes}}}.number("x", 0.0, 0.0, 1.0));
         });
}

void read_tuned(const std::string& bytes) {
    const WeightChanges changes = WeightChanges::load(scratch_file("in.safetensors", bytes));
    Model copy = test::tiny_model();
    changes.apply(copy);
}

}  // namespace

const std::map<std::string, Reader>& readers() {
    const auto path = [](const std::string& bytes) { return scratch_file("in", bytes); };
    static const std::map<std::string, Reader> all{
        {"safetensors", [=](const auto& b) { static_cast<void>(read_tensor_file(path(b))); }},
        {"torch", [=](const auto& b) { static_cast<void>(read_torch_file(path(b))); }},
        {"onnx", [=](const auto& b) { static_cast<void>(read_onnx_file(path(b))); }},
        {"config", read_configuration},
        {"faces", [=](const auto& b) { static_cast<void>(FaceRecords(path(b))); }},
        {"face_index",
         [=](const auto& b) {
             const std::filesystem::path faces = path("");
             const FileVersion version = version_of(faces);
             write_text_file(index_path(faces), "stymo-face-index-1 " +
                                                    std::to_string(version.size) + " " +
                                                    std::to_string(version.time) + " " +
                                                    std::to_string(crc32c(b)) + "\n" + b);
             static_cast<void>(read_face_index(faces, version));
         }},
        {"intrinsics", [=](const auto& b) { static_cast<void>(read_intrinsics(path(b))); }},
        {"photo_ids", [=](const auto& b) { static_cast<void>(read_photo_ids(path(b))); }},
        {"codes",
         [=](const auto& b) {
             each([&] { static_cast<void>(parse_code_file(b, "fuzzed")); },
                  [&] { static_cast<void>(read_pose(path(b))); });
         }},
        {"camera",
         [=](const auto& b) {
             each([&] { static_cast<void>(read_camera(path(b), "", {})); },
                  [&] { static_cast<void>(read_camera(path(b), "00000", {})); });
         }},
        {"head", [=](const auto& b) { static_cast<void>(read_morphable_head(path(b))); }},
        {"obj", [](const auto& b) { read_obj_folder("generic_neutral_mesh.obj", b); }},
        {"obj_indices", [](const auto& b) { read_obj_folder("vertex_indices.json", b); }},
        {"marks", [=](const auto& b) { static_cast<void>(read_marked_photos(path(b))); }},
        {"request", read_request},
        {"tuned", read_tuned},
        {"progress", [](const auto& b) { static_cast<void>(parse_photo_outcome(b)); }},
        {"scores", [](const auto& b) { static_cast<void>(parse_face_score(b)); }},
    };
    return all;
}

}  // namespace stymo::fuzz
