#include "apps/hostile_inputs.h"

#include <nlohmann/json.hpp>
#include <sstream>

#include "apps/tiny_run.h"
#include "core/io/file.h"
#include "core/io/image.h"
#include "core/io/tensor_file.h"

namespace stymo {

namespace {

namespace fs = std::filesystem;
using nlohmann::json;

const std::string nested = std::string(1000000, '[') + std::string(1000000, ']');

fs::path bad() {
    return tiny_run() / "bad";
}

void put(const std::string& name, const std::string& text) {
    fs::create_directories((bad() / name).parent_path());
    write_file(bad() / name, text);
}

std::string replaced(std::string text, const std::string& old, const std::string& by) {
    const std::size_t place = text.find(old);
    if (place == std::string::npos) throw std::runtime_error("there is no " + old);
    return text.replace(place, old.size(), by);
}

void put_configurations() {
    put("nested_config.json", "{\"decoder\": " + nested + "}");
    put("twice_config.json", R"({"stage1": {"steps": 1, "steps": 2}})");
    put("dotted_config.json", R"({"stage1.steps": 1})");
    put("section_config.json", R"({"stage1": 4})");
    put("list_config.json", "[]");
    put("nan_config.json", R"({"stage1": {"learning_rate": NaN}})");
    put("huge_config.json", R"({"camera": {"focal": 1e999}})");
    put("open_config.json", "{\"stage1\":\n {");
    put("circle_a.json", R"({"parent": "circle_b.json"})");
    put("circle_b.json", R"({"parent": "circle_a.json"})");
    put("orphan.json", R"({"parent": "nobody.json"})");
    put("parent_number.json", R"({"parent": 7})");
}

void put_codes() {
    const std::string text = read_file(tiny_run() / "fit/codes.json");
    json codes = json::parse(text);
    put("nested_codes.json", replaced(text, "\"pose\":", "\"pose\":" + nested + ",\"other\":"));
    put("twice_codes.json", replaced(text, "\"pose\":", "\"pose\":{},\"pose\":"));
    put("escaped_codes.json", replaced(text, "\"pose\":", "\"\\u0070ose\":{},\"pose\":"));
    put("nan_codes.json", replaced(text, "\"yaw_deg\":", "\"yaw_deg\":NaN,\"x\":"));
    put("cut_codes.json", text.substr(0, text.size() / 2));
    codes["code"]["light"].push_back(0.0);
    put("long_codes.json", codes.dump());
    put("pose_extra.json", replaced(text, "\"yaw_deg\":", "\"jaw_deg\":1,\"yaw_deg\":"));
}

/// A folder of one face with another file beside it.
void put_folder(const std::string& name, const std::string& file, const std::string& text) {
    fs::create_directories(bad() / name / "images");
    fs::copy_file(tiny_run() / "faces/images/00000.png", bad() / name / "images/00000.png");
    put(name + "/" + file, text);
}

void put_folders() {
    put_folder("line_twice", "faces.jsonl", R"({"id":"00000","id":"00001"})");
    put_folder("line_nested", "faces.jsonl", "{\"id\":\"00000\",\"code\":" + nested + "}");
    put_folder("line_nan", "faces.jsonl",
               R"({"id":"00000","pose":{"yaw_deg":NaN,"pitch_deg":0,"roll_deg":0,"t":[0,0,0]}})");
    put_folder("line_large", "faces.jsonl",
               R"({"id":"00000","pose":{"yaw_deg":1e300,"pitch_deg":0,"roll_deg":0,"t":[0,0,0]}})");
    put_folder("line_short", "faces.jsonl",
               R"({"id":"00000","code":{"id":[0],"expr":[0],"tex":[0],"light":[0]}})");
    put_folder("line_number", "faces.jsonl", R"({"id":0})");
    put_folder("line_array", "faces.jsonl", "[1]");
    put_folder("id_twice", "faces.jsonl", "{\"id\":\"00000\"}\n{\"id\":\"00000\"}\n");
    put_folder("camera_twice", "camera.json", R"({"focal":3,"focal":4})");
    put_folder("camera_nested", "camera.json", nested);
    put_folder("camera_negative", "camera.json", R"({"focal":-1})");
    put_folder("camera_center", "camera.json", R"({"focal":2.03,"cx":2.5})");
    put_folder("camera_pixels", "camera.json", R"({"focal":1015})");
    put_folder("camera_text", "camera.json", "focal 3");
    put_folder("camera_key", "camera.json", R"({"fokal":3})");
    put_folder("camera_large", "camera.json", R"({"cx":1e300})");
    put_folder("same_ids", "images/00000.jpg", read_file(tiny_run() / "whole.jpg"));
    put_folder("mask_zero", "masks/00000.png", "");
    put_folder("mask_text", "masks/00000.png", "no image\n");
    put_folder("map_of_colours", "parsing/00000.png",
               read_file(tiny_run() / "faces/images/00000.png"));
    put_folder("map_cut", "parsing/00000.png",
               read_file(tiny_run() / "faces/masks/00000.png").substr(0, 80));
    put_folder("map_wide", "parsing/00000.png", png_bytes(Tensor::full({32, 64, 1}, 0.0)));
    put_folder("only_text", "images/00000.png", "no image\n");
}

std::string header(std::uint64_t length, const std::string& rest) {
    return std::string(reinterpret_cast<const char*>(&length), sizeof length) + rest;
}

void put_models() {
    const std::string model = read_file(tiny_run() / "run/model.safetensors");
    put("long_header.safetensors", header(std::uint64_t{1} << 32, "{}"));
    put("nested.safetensors", header(2000000, nested));
    put("system.pth", read_file(fs::path(STYMO_SOURCE_DIR) / "tests/golden/weights/system.pth"));
    put("text.safetensors", "no tensors, but words\n");
    put("rest.safetensors", model + "more");
    TensorFile file = read_tensor_file(tiny_run() / "run/model.safetensors");
    const auto put_tensors = [](const std::string& name, const TensorFile& changed) {
        write_tensor_file(bad() / name, changed);
    };
    TensorFile other = file;
    other.metadata["config"] = replaced(other.metadata["config"], "\"decoder\"", "\"dekoder\"");
    put_tensors("key.safetensors", other);
    other.metadata["config"] = "{";
    put_tensors("config.safetensors", other);
    other = file;
    other.metadata["config"] = R"({"decoder": {"field_width": 4096, "field_layers": 32}})";
    put_tensors("claims.safetensors", other);
    other = file;
    Tensor& weight = other.tensors.at("decoder.field.density.weight");
    weight = Tensor::full(weight.shape(), std::numeric_limits<double>::quiet_NaN());
    put_tensors("nan.safetensors", other);
    other = file;
    other.tensors.clear();
    other.metadata = {{"format", "stymo-weight-changes-1"}, {"model", "0"}};
    put_tensors("foreign_tuned.safetensors", other);
    other.tensors["../../etc/passwd"] = Tensor::zeros({3});
    put_tensors("names.safetensors", other);
}

void put_poses() {
    put("numbers_11.txt", "1 2 3 4 5 6 7 8 9 10 11");
    put("numbers_words.txt", "1 2 three");
    put("not_orthonormal.txt", "2 0 0 0 0 1 0 0 0 0 1 5 0 0 0 1");
    put("far.txt", "1 0 0 1e300 0 1 0 0 0 0 1 5 0 0 0 1");
    put("nested_pose.json", nested);
    put("labels.json", R"({"labels": [["a.png", [1, 2]]]})");
    put("twice_pose.json", R"({"yaw_deg":0,"yaw_deg":9,"pitch_deg":0,"roll_deg":0,"t":[0,0,0]})");
}

void put_heads() {
    put("head_indices/generic_neutral_mesh.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 -7\n");
    put("head_words/generic_neutral_mesh.obj", "v 0 0 nowhere\n");
    put("head_infinite/generic_neutral_mesh.obj", "v 0 0 inf\n");
    put("head_outside/generic_neutral_mesh.obj", "v 0 0 0\n");
    put("head_outside/vertex_indices.json", R"({"expressions": ["../../file"]})");
    put("head_nested/generic_neutral_mesh.obj", "v 0 0 0\n");
    put("head_nested/vertex_indices.json", nested);
    TensorFile head;
    head.tensors["mean"] = Tensor::zeros({2, 2});
    write_tensor_file(bad() / "head.safetensors", head);
}

void put_begun_jobs() {
    const std::string settings = "{}\n";
    put("prep_text/settings.json", "text\n");
    for (const char* folder : {"prep_settings", "prep_line", "prep_nested", "prep_file"})
        put(std::string(folder) + "/settings.json", settings);
    put("prep_line/progress.jsonl", "text\n");
    put("prep_nested/progress.jsonl", nested + "\n");
    put("prep_file/progress.jsonl", "{\"file\": 7}\n");
    put("eval_settings/settings.json", settings);
    put("eval_scores/scores.jsonl", "{}\n");
}

}  // namespace

const fs::path& hostile_inputs() {
    static const bool made = [] {
        put_configurations();
        put_codes();
        put_folders();
        put_models();
        put_poses();
        put_heads();
        put_begun_jobs();
        return true;
    }();
    static_cast<void>(made);
    return tiny_run();
}

}  // namespace stymo
