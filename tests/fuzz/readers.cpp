#include "fuzz/readers.h"

#include <cstdlib>
#include <cstring>

#include "apps/common/result_folder.h"
#include "apps/eval/score.h"
#include "apps/prep/camera_file.h"
#include "apps/prep/photo_outcome.h"
#include "core/config.h"
#include "core/error.h"
#include "core/io/checksum.h"
#include "core/io/image.h"
#include "core/io/image_color.h"
#include "core/io/onnx_file.h"
#include "core/io/tensor_file.h"
#include "core/io/torch_file.h"
#include "fit/photo/onnx_network.h"
#include "fuzz/http_client.h"
#include "fuzz/png_checksums.h"
#include "fuzz/request_readers.h"
#include "fuzz/scratch_file.h"
#include "nn/models/code_file.h"
#include "nn/models/weight_changes.h"
#include "nn/pretrained/perceptual/lpips.h"
#include "nn/pretrained/weights_import.h"
#include "render/morphable/head_source.h"
#include "support/tiny_model.h"
#include "train/checkpoint.h"
#include "train/data/face_records.h"
#include "train/data/folder_records.h"
#include "train/train_config.h"

namespace stymo::fuzz {

namespace {

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

/// Most of a tiny model is its encoder and its mapping networks.
ModelConfig small_model_config() {
    ModelConfig config = test::tiny_model_config();
    config.code_source = "morphable";
    config.decoder.mapping_layers = 0;
    return config;
}

Model small_model() {
    Rng rng(1);
    return {small_model_config(), rng};
}

/// The bytes are the configuration in a file of a model that is valid otherwise.
void read_model(const std::string& bytes) {
    struct Parts {
        std::string header_before, header_after, tensors;
    };
    static const Parts parts = [] {
        const std::filesystem::path path = scratch_file("whole.safetensors", "");
        small_model().save(path);
        const std::string whole = read_file(path);
        std::uint64_t length = 0;
        std::memcpy(&length, whole.data(), sizeof length);
        const std::string header = whole.substr(sizeof length, length);
        const std::string config = JsonValue(to_json(small_model_config())).text();
        const std::size_t at = header.find(config);
        if (at == std::string::npos) std::abort();
        return Parts{header.substr(0, at), header.substr(at + config.size()),
                     whole.substr(sizeof length + length)};
    }();
    const std::string header = parts.header_before + JsonValue(bytes).text() + parts.header_after;
    const auto length = static_cast<std::uint64_t>(header.size());
    std::string file(reinterpret_cast<const char*>(&length), sizeof length);
    file += header;
    file += parts.tensors;
    static_cast<void>(Model::load(scratch_file("model.safetensors", file), ModelParts::all));
}

/// The bytes are the state in a checkpoint whose model is valid.
void read_state(const std::string& bytes) {
    static Model model = [] {
        Model made = small_model();
        made.save(scratch_file("checkpoint/model.safetensors", ""));
        return made;
    }();
    const auto file = scratch_file("checkpoint/state.safetensors", bytes);
    static_cast<void>(read_checkpoint(file.parent_path(), model, 1));
}

/// The bytes are the list of checksums of a folder with one other file.
void read_checksums(const std::string& bytes) {
    static_cast<void>(scratch_file("checked/file", "contents"));
    verify_checksums(scratch_file("checked/checksums.txt", bytes).parent_path());
}

void read_progress(const std::string& bytes) {
    OneRank alone;
    each([&] { static_cast<void>(parse_photo_outcome(bytes)); },
         [&] {
             static_cast<void>(scratch_file("progress/settings.json", "{}"));
             const auto file = scratch_file("progress/progress.jsonl", bytes);
             static_cast<void>(ResultFolder(file.parent_path(), {}, "progress", "file", alone));
         });
}

/// The bytes are one file of a folder that is complete otherwise.
void read_obj_folder(const std::string& name, const std::string& bytes) {
    static const std::string indices = [] {
        std::string landmarks;
        for (int k = 0; k < 68; ++k) landmarks += (k > 0 ? "," : "") + std::to_string(k / 48);
        const std::string mesh = "v 0 3 8\nv 1 -4 8\nv -1 -4 8\nf 1 2 3\n";
        for (const char* file : {"generic_neutral_mesh.obj", "identity000.obj", "jawOpen.obj"})
            static_cast<void>(scratch_file(file, mesh));
        return R"({"expressions": ["jawOpen"], "idx_to_landmark_verts": [)" + landmarks + "]}";
    }();
    if (name != "vertex_indices.json")
        static_cast<void>(scratch_file("vertex_indices.json", indices));
    static_cast<void>(scratch_file(name, bytes));
    static_cast<void>(read_obj_head(scratch_folder()));
}

/// Photos as PNG or JPEG; OpenImageIO reads other formats too.
void read_photo(const std::string& bytes) {
    constexpr std::int64_t most_pixels = 1 << 20;
    const bool png = bytes.starts_with("\x89PNG\r\n\x1a\n");
    if (!png && !bytes.starts_with("\xff\xd8\xff")) return;
    const std::string name = png ? "in.png" : "in.jpg";
    static_cast<void>(
        read_image(scratch_file(name, png ? with_png_checksums(bytes) : bytes), most_pixels));
}

/// What OpenCV makes of a network of ours, on a small image.
void run_network(const std::filesystem::path& path) {
    OnnxNetwork network(path);
    static_cast<void>(network.run(Tensor::full({16, 16, 3}, 0.5),
                                  {.mean = {0.5F, 0.5F, 0.5F}, .deviation = {1.0F, 1.0F, 1.0F}}));
}

void read_tuned(const std::string& bytes) {
    const WeightChanges changes = WeightChanges::load(scratch_file("in.safetensors", bytes));
    Model copy = small_model();
    changes.apply(copy);
}

}  // namespace

const std::map<std::string, Reader>& readers() {
    const auto path = [](const std::string& bytes) { return scratch_file("in", bytes); };
    static const std::map<std::string, Reader> all{
        {"safetensors", [=](const auto& b) { static_cast<void>(read_tensor_file(path(b))); }},
        {"torch", [=](const auto& b) { static_cast<void>(read_torch_file(path(b))); }},
        {"onnx", [=](const auto& b) { static_cast<void>(read_onnx_file(path(b))); }},
        {"onnx_plain", [=](const auto& b) { static_cast<void>(read_plain_onnx(path(b))); }},
        {"onnx_network", [=](const auto& b) { run_network(path(b)); }},
        {"config", read_configuration},
        {"faces", [=](const auto& b) { static_cast<void>(FaceRecords(path(b))); }},
        {"face_index",
         [=](const auto& b) {
             static const std::filesystem::path faces = path(std::string(100, ' '));
             static const FileVersion version = version_of(faces);
             static const std::string title = "stymo-face-index-2 " + std::to_string(version.size) +
                                              " " + std::to_string(version.time) + " ";
             static_cast<void>(
                 scratch_file("in.index", title + std::to_string(crc32c(b)) + "\n" + b));
             static_cast<void>(read_face_index(faces, version));
         }},
        {"intrinsics", [=](const auto& b) { static_cast<void>(read_intrinsics(path(b))); }},
        {"photo_ids", [=](const auto& b) { static_cast<void>(read_photo_ids(path(b))); }},
        {"eg3d", [=](const auto& b) { static_cast<void>(read_eg3d_cameras(path(b))); }},
        {"color_tags", [](const auto& b) { static_cast<void>(color_tags(b, {})); }},
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
        {"lpips",
         [=](const auto& b) { static_cast<void>(read_lpips_heads(path(b), "squeezenet1_1")); }},
        {"import", [=](const auto& b) { static_cast<void>(import_weights(path(b))); }},
        {"model", read_model},
        {"state", read_state},
        {"checksums", read_checksums},
        {"class_map",
         [](const auto& b) {
             static_cast<void>(read_class_map(scratch_file("in.png", with_png_checksums(b))));
         }},
        {"photo", read_photo},
        {"obj", [](const auto& b) { read_obj_folder("generic_neutral_mesh.obj", b); }},
        {"obj_indices", [](const auto& b) { read_obj_folder("vertex_indices.json", b); }},
        {"request", read_request_body},
        {"http", send_to_server},
        {"tuned", read_tuned},
        {"progress", read_progress},
        {"scores", [](const auto& b) { static_cast<void>(parse_face_score(b)); }},
    };
    return all;
}

}  // namespace stymo::fuzz
