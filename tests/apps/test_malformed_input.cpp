// Malformed calls, configurations and files: what each tool says, word for word, and that it writes
// nothing.
#include <catch2/catch.hpp>
#include <map>

#include "apps/hostile_inputs.h"
#include "apps/tool_run.h"

namespace malformed_input_tests {

namespace {

namespace fs = std::filesystem;
using stymo::hostile_inputs;
using stymo::ToolOutcome;

struct Row {
    std::string command;
    int exit_code = 1;
    /// The line on stderr behind the tool's name, and before the hint at --help that wrong usage
    /// gets; "..." stands for the rest of it.
    std::string line;
};

std::map<fs::path, std::uintmax_t> files_with_sizes() {
    std::map<fs::path, std::uintmax_t> files;
    for (const auto& entry : fs::recursive_directory_iterator(hostile_inputs()))
        files.emplace(entry.path(), entry.is_regular_file() ? entry.file_size() : 0);
    return files;
}

bool fits(const std::string& text, const std::string& line) {
    if (!line.ends_with("...")) return text == line + "\n";
    return text.starts_with(line.substr(0, line.size() - 3)) && stymo::line_count(text) == 1;
}

std::string hint(const std::string& tool, int exit_code, const std::string& line) {
    return exit_code == 2 && !line.ends_with("...") ? "; see " + tool + " --help" : "";
}

void check_refused(const std::vector<Row>& rows) {
    const auto before = files_with_sizes();
    for (const auto& [command, exit_code, line] : rows) {
        const ToolOutcome outcome = stymo::run_tool(hostile_inputs(), command);
        INFO(command << "\nexpected: " << line << "\nsaid: " << outcome.err);
        CHECK(outcome.exit_code == exit_code);
        CHECK(outcome.out.empty());
        const std::string tool = command.substr(0, command.find(' '));
        CHECK(fits(outcome.err, tool + ": " + line + hint(tool, exit_code, line)));
    }
    CHECK(files_with_sizes() == before);
}

const std::string image =
    "stymo-render --model run/model.safetensors --codes fit/codes.json --out out.png ";
const std::string render = "stymo-render --model run/model.safetensors --codes fit/codes.json ";
const std::string model = "stymo-render --codes fit/codes.json --out out.png --model bad/";
const std::string codes = "stymo-render --model run/model.safetensors --out out.png --codes ";
const std::string fit = "stymo-fit --model run/model.safetensors --out out --image whole.jpg ";
const std::string folder = "stymo-eval --model run/model.safetensors --data bad/";
const std::string eval = "stymo-eval --model run/model.safetensors --data faces ";
const std::string train = "stymo-train --config tiny.json --data faces --out out ";
const std::string prep = "stymo-prep --photos faces --out ";
const std::string pose = "stymo-prep pose --out out ";
const std::string view =
    "stymo-view --model run/model.safetensors --codes fit/codes.json --port 0 ";
const std::string synth = "stymo-synth --out out ";

}  // namespace

TEST_CASE("Malformed command lines are refused, in one line that says why") {
    check_refused({
        {synth + "--size 4", 2, "--size: 4 is not a number in [8, 4096]"},
        {synth + "--size 64 --seed x", 2, "Could not convert: --seed = x"},
        {synth + "--threads 2000", 2, "--threads: 2000 is not a number in [0, 1024]"},
        {synth + "--people 3", 2, "--people requires --heads"},
        {synth + "--heads h.safetensors --count 3", 2, "--count excludes --heads"},
        {synth + "extra", 2, "The following argument was not expected: extra"},
        {"stymo-synth --count 3", 2, "--out is required"},
        {"stymo-bench", 2, "a command is required: render, edit, fit, ..."},
        {"stymo-bench fast", 2, "there is no command fast; give one of render, edit, fit, ..."},
        {"stymo-bench row", 2, "NAME is required"},
        {"stymo-bench row nothing", 2, "there is no row nothing; stymo-bench rows lists them"},
        {"stymo-bench render --repeats 0", 2, "--repeats: 0 is not a number in [1, 1000]"},
        {"stymo-bench report", 2, "--out is required"},
        {"stymo-edit fast", 2, "there is no command fast; give one of mix, color, disentangle"},
        {"stymo-weights show", 2, "file is required"},
        {"stymo-weights publish run/model.safetensors", 2, "out is required"},
        {"stymo-weights import run/model.safetensors out.txt", 2,
         "out.txt: the name must end in .safetensors"},
        {"stymo-eval fast", 2, "The following argument was not expected: fast"},
        {"stymo-eval pair whole.jpg", 2, "B is required"},
        {"stymo-prep pose --yaw 400", 2, "--yaw: 400 is not a number in [-180, 180]"},
        {"stymo-prep --out out", 2, "--photos is required"},
        {prep + "out --size 0", 2, "--size: 0 is not a number in [8, 4096]"},
        {train + "--measure all", 2, "--measure requires --dry-run"},
        {train + "--head-mask --dry-run", 2, "--dry-run excludes --head-mask"},
        {train + "--head-mask --resume run", 2, "--head-mask goes on with --resume latest alone"},
        {train + "--max-minutes soon", 2, "--max-minutes: soon is not a number in [0, 1000000]"},
        {"stymo-view --port 70000", 2, "--port: 70000 is not a number in [0, 65535]"},
        {"stymo-view --psnr 5", 2, "--psnr: 5 is not a number in [20, 90]"},
        {"stymo-view --mode fast", 2, "--mode: fast not in {exact,skip}"},
        {"stymo-view --sessions 0", 2, "--sessions: 0 is not a number in [1, 1000]"},
        {"stymo-view --token a&b", 2, "--token: use only letters, digits and . _ ~ -"},
        {"stymo-view --token=", 2, "--token: the value is empty"},
        {image + "--seed 99999999999999999999", 2,
         "--seed: 99999999999999999999 is no whole number below 18446744073709551616"},
        {"stymo-render --model run/model.safetensors --sample 2 --out new.png", 2,
         "--sample needs --out, the name of a folder"},
        {image + "--samples 1", 2, "--samples: 1 is not a number in [2, 4096]"},
        {image + "--tolerance 0.1 --psnr 40", 2, "--psnr excludes --tolerance"},
        {image + "--psnr 5", 2, "--psnr: 5 is not a number in [20, 90]"},
        {image + "--mode fast", 2, "--mode: fast not in {exact,skip}"},
        {render + "--out out.gif --grid-yaw 1:2", 2,
         "out.gif: the name must end in .png or .jpg or .exr; films need --orbit, or --to another "
         "face"},
        {image + "--grid-yaw 1:2:1000", 2,
         "--grid-yaw 1:2:1000: give FROM:TO:COUNT in degrees, such as -30:30:5, of 1 to 100 "
         "angles"},
        {image + "--to fit/codes.json --take nose", 2,
         "--take nose: \"nose\" is no group of codes; there are id, expr, tex "
         "and light"},
        {render + "--out out.gif --orbit -3", 2, "--orbit: -3 is not a number in [0, 10000]"},
        {render + "--mesh out.obj", 2, "out.obj: the name must end in .ply"},
        {image + "--mesh-level 1", 2, "--mesh-level requires --mesh"},
        {image + "--frames 3", 2, "--frames requires --to"},
        {fit + "--image whole.jpg --as-is", 2,
         "several photos are prepared by the tool itself: leave out --mask, --pose, --data and "
         "--as-is"},
        {fit + "--optimizer sgd", 2, "--optimizer: sgd not in {adam,lbfgs}"},
        {fit + "--tolerance 2", 2, "--tolerance: 2 is not a number in [0, 1]"},
        {eval + "--resolution 32", 2, "--resolution: 32 is not a number in [64, 4096]"},
        {eval + "--resolution 96", 1, "this model renders images with a side of 64, not 96"},
        {eval + "--ids 9999999999999999999999", 2,
         "--ids 9999999999999999999999: must be a range of positions in the order of ids, such as "
         "700-799, or a file of ids"},
        {eval + "--ids -1", 2,
         "--ids -1: must be a range of positions in the order of ids, such as 700-799, or a file "
         "of ids"},
    });
}

TEST_CASE("Malformed configurations are refused, in one line that says why") {
    check_refused({
        {"stymo-train --config bad/nested_config.json --data faces --out out", 1,
         "bad/nested_config.json: nested deeper than 32 levels"},
        {"stymo-train --config bad/twice_config.json --data faces --out out", 1,
         "bad/twice_config.json: the key \"steps\" is given twice in one object"},
        {"stymo-train --config bad/dotted_config.json --data faces --out out", 1,
         "bad/dotted_config.json: stage1.steps: must be written as nested objects"},
        {"stymo-train --config bad/section_config.json --data faces --out out", 1,
         "bad/section_config.json: stage1 = 4: must be an object"},
        {"stymo-train --config bad/list_config.json --data faces --out out", 1,
         "bad/list_config.json: must be a JSON object"},
        {"stymo-train --config bad/nan_config.json --data faces --out out", 1,
         "bad/nan_config.json: not JSON at line 1"},
        {"stymo-train --config bad/huge_config.json --data faces --out out", 1,
         "bad/huge_config.json: a number is too large"},
        {"stymo-train --config bad/open_config.json --data faces --out out", 1,
         "bad/open_config.json: not JSON at line 2"},
        {"stymo-train --config bad/circle_a.json --data faces --out out", 1,
         "bad/circle_a.json: its parents lead back to itself"},
        {"stymo-train --config bad/orphan.json --data faces --out out", 1,
         "bad/nobody.json: cannot be read (No such file or directory)"},
        {"stymo-train --config bad/parent_number.json --data faces --out out", 1,
         "bad/parent_number.json: parent = 7: must be a file name"},
        {"stymo-train --config faces --data faces --out out", 1,
         "faces: cannot be read (is a folder)"},
        {train + "--set encoder.backbone_weights=text.png", 1,
         "encoder.backbone_weights: text.png: not a readable safetensors file (it does not begin "
         "with the length of a header)"},
        {train + "--set encoder.backbone_weights=none.onnx", 1,
         "encoder.backbone_weights: no file none.onnx; name an existing file, or set the key to "
         "random to train the backbone from scratch"},
        {train + "--set stage1.steps=4.5", 1,
         "command line: stage1.steps = 4.5: must be an integer in [0, 100000000]"},
        {train + "--set stage1.steps=1e30", 1,
         "command line: stage1.steps = 1e+30: must be an integer in [0, 100000000]"},
        {train + "--set decoder={\"field_width\":3}", 1,
         "command line: decoder: unknown key; did you mean decoder.render?"},
        {train + "--set decoder.block_channels=8", 1,
         "command line: decoder.block_channels = 8: must be an array of integers in [1, 4096]"},
        {train + "--set =3", 1, "\"=3\": must be key=value"},
        {train + "--set stage1.learning_rate=NaN", 1,
         "command line: stage1.learning_rate: unknown key; did you mean optimizer.learning_rate?"},
        {train + "--set data.mirror=maybe", 1,
         "command line: data.mirror = \"maybe\": must be true or false"},
        {train + "--resume run", 1,
         "run/state.safetensors: cannot be read (No such file or directory)"},
        {train + "--resume text.png", 1,
         "text.png/state.safetensors: cannot be read (Not a directory)"},
    });
}

TEST_CASE("Malformed folders of faces are refused, in one line that says why") {
    check_refused({
        {folder + "line_twice", 1,
         "bad/line_twice/faces.jsonl, line 1: the key \"id\" is given twice in one object"},
        {folder + "line_nested", 1,
         "bad/line_nested/faces.jsonl, line 1: nested deeper than 32 levels"},
        {folder + "line_nan", 1,
         "bad/line_nan/faces.jsonl, line 1: not JSON: parse error at line 1..."},
        {folder + "line_large", 1,
         "bad/line_large/faces.jsonl, line 1: \"yaw_deg\" holds 1e+300, which is too large"},
        {folder + "line_short", 1,
         "bad/line_short/faces.jsonl, line 1: \"id\" must be an array of 100 numbers"},
        {folder + "line_number", 1, "bad/line_number/faces.jsonl, line 1: no \"id\" text"},
        {folder + "line_array", 1,
         "bad/line_array/faces.jsonl, line 1: the line must be an object"},
        {folder + "id_twice", 1, "bad/id_twice/faces.jsonl, line 2: the id \"00000\" comes twice"},
        {folder + "camera_twice", 1,
         "bad/camera_twice/camera.json: the key \"focal\" is given twice in one object"},
        {folder + "camera_nested", 1,
         "bad/camera_nested/camera.json: nested deeper than 32 levels"},
        {folder + "camera_negative", 1,
         "bad/camera_negative/camera.json: \"focal\" is -1, in units of the image's side: it must "
         "be in [0.1, 100]"},
        {folder + "camera_center", 1,
         "bad/camera_center/camera.json: \"cx\" is 2.5, in units of the image's side: it must be "
         "in [-1, 2]"},
        {folder + "camera_pixels", 1,
         "bad/camera_pixels/camera.json: \"focal\" is 1015, in units of the image's side: it must "
         "be in [0.1, 100]"},
        {folder + "camera_text", 1,
         "bad/camera_text/camera.json: not JSON: parse error at line 1..."},
        {folder + "camera_key", 1, "bad/camera_key/camera.json: unknown key \"fokal\" in the file"},
        {folder + "camera_large", 1,
         "bad/camera_large/camera.json: \"cx\" holds 1e+300, which is too large"},
        {folder + "same_ids", 1,
         "two images have the id \"00000\": bad/same_ids/images/00000.jpg and "
         "bad/same_ids/images/00000.png; rename or remove one"},
        {folder + "mask_zero", 1,
         "none of the 1 faces could be scored; the first: bad/mask_zero/masks/00000.png: not an "
         "image (zero bytes)"},
        {folder + "mask_text", 1,
         "none of the 1 faces could be scored; the first: bad/mask_text/masks/00000.png: not an "
         "image"},
        {folder + "map_of_colours", 1,
         "none of the 1 faces could be scored; the first: bad/map_of_colours/parsing/00000.png: "
         "not a class map (needs an 8-bit palette or grey PNG)"},
        {folder + "map_cut", 1,
         "none of the 1 faces could be scored; the first: bad/map_cut/parsing/00000.png: cannot be "
         "read (truncated image)"},
        {folder + "map_wide", 1,
         "none of the 1 faces could be scored; the first: bad/map_wide/parsing/00000.png: has 64 x "
         "32 pixels, its image 64 x 64; the frames must agree"},
        {folder + "only_text", 1,
         "none of the 1 faces could be scored; the first: bad/only_text/images/00000.png: not an "
         "image"},
        {"stymo-train --config tiny.json --data bad/line_twice --out out", 1,
         "bad/line_twice/faces.jsonl, line 1: the key \"id\" is given twice in one object"},
        {"stymo-train --config tiny.json --data bad/map_wide --out out --set data.split.test=0", 1,
         "bad/map_wide: none of its 1 images can be read; the first: "
         "bad/map_wide/parsing/00000.png: has 64 x 32 pixels, its image 64 x 64; the frames must "
         "agree"},
        {"stymo-prep --photos bad/id_twice --out out", 1,
         "bad/id_twice/faces.jsonl, line 2: the id \"00000\" comes twice"},
        {"stymo-prep --photos bad/same_ids --out out", 1,
         "two images have the id \"00000\": bad/same_ids/images/00000.jpg and "
         "bad/same_ids/images/00000.png; rename or remove one"},
        {"stymo-fit --model run/model.safetensors --data bad/map_wide --id 00000 --out out", 1,
         "bad/map_wide/parsing/00000.png: has 64 x 32 pixels, its image 64 x 64; the frames must "
         "agree"},
    });
}

TEST_CASE("Malformed models, weights and heads are refused, in one line that says why") {
    check_refused({
        {model + "long_header.safetensors", 1,
         "bad/long_header.safetensors: not a readable safetensors file (it does not begin with the "
         "length of a header)"},
        {model + "nested.safetensors", 1,
         "bad/nested.safetensors: not a readable safetensors file (its header: nested deeper than "
         "32 levels)"},
        {model + "text.safetensors", 1,
         "bad/text.safetensors: not a readable safetensors file (it does not begin with the length "
         "of a header)"},
        {model + "rest.safetensors", 1,
         "bad/rest.safetensors: not a readable safetensors file (4 bytes at the end belong to no "
         "tensor)"},
        {model + "key.safetensors", 1,
         "bad/key.safetensors: dekoder: unknown key; did you mean decoder.render?"},
        {model + "config.safetensors", 1, "bad/config.safetensors: not JSON at line 1"},
        {model + "claims.safetensors", 1,
         "bad/claims.safetensors: decoder.field.density.weight has shape (1, 16), the model needs "
         "(1, 4096)"},
        {model + "nan.safetensors", 1,
         "bad/nan.safetensors: decoder.field.density.weight holds values that are not finite"},
        {model + "foreign_tuned.safetensors", 1,
         "bad/foreign_tuned.safetensors: not a model of stymo (its metadata lack \"format\": "
         "\"stymo-model-1\" or \"config\")"},
        {image + "--tuned bad/foreign_tuned.safetensors", 1,
         "bad/foreign_tuned.safetensors: these weight changes were made for another model (0, not "
         "..."},
        {image + "--tuned text.png", 1,
         "text.png: not a readable safetensors file (it does not begin with the length of a "
         "header)"},
        {image + "--tuned bad/names.safetensors", 1,
         "bad/names.safetensors: these weight changes were made for another model (0, not ..."},
        {"stymo-weights show text.png", 1,
         "text.png: not a weight file (neither safetensors, ONNX nor PyTorch)"},
        {"stymo-weights show bad/nested.safetensors", 1,
         "bad/nested.safetensors: not a weight file (neither safetensors, ONNX nor PyTorch)"},
        {"stymo-weights show empty", 1, "empty: cannot be read (is a folder)"},
        {"stymo-weights import text.png out.safetensors", 1,
         "text.png: not a weight file (neither safetensors, ONNX nor PyTorch)"},
        {"stymo-weights import bad/system.pth out.safetensors", 1,
         "bad/system.pth: refuses to load \"posix.system\": not a tensor or container; in Python, "
         "save the "
         "state dict alone"},
        {"stymo-weights publish fit/codes.json out.safetensors", 1,
         "fit/codes.json: not a readable safetensors file (it does not begin with the length of a "
         "header)"},
        {"stymo-view --model bad/claims.safetensors --port 0", 1,
         "bad/claims.safetensors: encoder.backbone.conv1.weight has shape (64, 3, 3, 32), the "
         "model needs (64, 3, 3, 3)"},
        {"stymo-view --model run/model.safetensors --codes text.png --port 0", 1,
         "text.png: not JSON: parse error at line 1..."},
        {view + "--parser text.png", 1, "text.png: not an ONNX network"},
        {view + "--parser none", 1, "none: cannot be read (No such file or directory)"},
        {eval + "--identity text.png", 1,
         "text.png: not a readable safetensors file (it does not begin with the length of a "
         "header)"},
        {eval + "--parser text.png --region face", 1, "text.png: not an ONNX network"},
        {"stymo-bench render --model text.png --out out", 1,
         "text.png: not a readable safetensors file (it does not begin with the length of a "
         "header)"},
        {prep + "out --mask-net run/model.safetensors", 1,
         "run/model.safetensors: not a head-mask network of stymo"},
        {prep + "out --mask-net text.png", 1,
         "text.png: not a readable safetensors file (it does not begin with the length of a "
         "header)"},
        {prep + "out --morphable bad/head.safetensors", 1,
         "bad/head.safetensors: \"mean\" is (2, 2), expected (V, 3)"},
        {synth + "--heads bad/head.safetensors", 1,
         "bad/head.safetensors: holds no tensor \"vertices\"; is it a file of textured heads?"},
        {synth + "--morphable bad/head_indices", 1,
         "bad/head_indices/generic_neutral_mesh.obj: line 4 names vertex -7 of 3"},
        {synth + "--morphable bad/head_words", 1,
         "bad/head_words/generic_neutral_mesh.obj: line 1: \"nowhere\" is not a number"},
        {synth + "--morphable bad/head_infinite", 1,
         "bad/head_infinite/generic_neutral_mesh.obj: line 1 holds inf"},
        {synth + "--morphable bad/head_outside", 1,
         "bad/head_outside/vertex_indices.json: \"expressions\" holds \"../../file\", which is no "
         "name of a file in this folder"},
        {synth + "--morphable bad/head_nested", 1,
         "bad/head_nested/vertex_indices.json: nested deeper than 32 levels"},
        {synth + "--morphable empty", 1,
         "empty/generic_neutral_mesh.obj: cannot be read (No such file or directory)"},
    });
}

TEST_CASE("Malformed codes, poses and begun jobs are refused, in one line that says why") {
    check_refused({
        {codes + "bad/nested_codes.json", 1, "bad/nested_codes.json: nested deeper than 32 levels"},
        {codes + "bad/twice_codes.json", 1,
         "bad/twice_codes.json: the key \"pose\" is given twice in one object"},
        {codes + "bad/escaped_codes.json", 1,
         "bad/escaped_codes.json: the key \"pose\" is given twice in one object"},
        {codes + "bad/nan_codes.json", 1, "bad/nan_codes.json: not JSON: parse error at line 1..."},
        {codes + "bad/cut_codes.json", 1, "bad/cut_codes.json: not JSON: parse error at line 1..."},
        {codes + "bad/long_codes.json", 1,
         "bad/long_codes.json: \"light\" is not an array of 27 numbers"},
        {codes + "bad/pose_extra.json", 1,
         "bad/pose_extra.json: unknown key \"jaw_deg\" in \"pose\""},
        {codes + "fit", 1, "fit: cannot be read (is a folder)"},
        {codes + "zero.png", 1, "zero.png: not JSON: parse error at line 1..."},
        {render + "--out out.gif --to text.png", 1, "text.png: not JSON: parse error at line 1..."},
        {"stymo-edit mix --model run/model.safetensors --source bad/twice_codes.json --target "
         "fit/codes.json --take id --out out",
         1, "bad/twice_codes.json: the key \"pose\" is given twice in one object"},
        {pose + "none.json", 1, "none.json: cannot be read (No such file or directory)"},
        {pose + "text.png", 1, "text.png: neither JSON nor numbers"},
        {pose + "zero.png", 1, "zero.png: neither JSON nor numbers"},
        {pose + "bad/numbers_11.txt", 1,
         "bad/numbers_11.txt: holds 11 numbers; 25 (EG3D), 16 (4x4) or 12 (3x4) make a camera"},
        {pose + "bad/numbers_words.txt", 1, "bad/numbers_words.txt: neither JSON nor numbers"},
        {pose + "bad/not_orthonormal.txt", 1,
         "bad/not_orthonormal.txt: its rotation is not orthonormal"},
        {pose + "bad/far.txt", 1, "bad/far.txt: its centre is more than 1e+06 from the origin"},
        {pose + "bad/nested_pose.json", 1, "bad/nested_pose.json: nested deeper than 32 levels"},
        {pose + "bad/twice_pose.json", 1,
         "bad/twice_pose.json: the key \"yaw_deg\" is given twice in one object"},
        {pose + "bad/labels.json", 1, "bad/labels.json: holds many poses; name one with --id"},
        {pose + "bad/labels.json --id a.png", 1,
         "bad/labels.json: holds 2 numbers; 25 (EG3D), 16 (4x4) or 12 (3x4) make a camera"},
        {pose + "bad/labels.json --id b.png", 1, "bad/labels.json: holds no label of b.png"},
        {pose + "faces/faces.jsonl --id 77", 1, "faces/faces.jsonl: holds no face with the id 77"},
        {fit + "--pose bad/twice_pose.json", 1,
         "bad/twice_pose.json: the key \"yaw_deg\" is given twice in one object"},
        {fit + "--pose bad/nested_codes.json", 1,
         "bad/nested_codes.json: nested deeper than 32 levels"},
        {fit + "--mask text.png", 1, "text.png: not an image"},
        {fit + "--max-pixels 10", 1,
         "whole.jpg: cannot be read (image too large: 64 x 64 pixels; at most 10 are allowed, see "
         "--max-pixels)"},
        {prep + "none --whole-head --pose-net none.onnx", 2,
         "--whole-head needs the poses of the fitted head; leave out --pose-net"},
        {prep + "bad/prep_text", 1,
         "bad/prep_text: its settings are not JSON; remove the folder and start again"},
        {prep + "bad/prep_line", 1,
         "bad/prep_line/progress.jsonl, line 1: not JSON; remove the folder and start again"},
        {prep + "bad/prep_settings", 1,
         "bad/prep_settings: was begun with other settings (--all-faces was \"unknown\", now "
         "false); give the same ones or another --out"},
        {prep + "bad/prep_nested", 1,
         "bad/prep_nested/progress.jsonl, line 1: nested deeper than 32 levels; remove the folder "
         "and start again"},
        {prep + "bad/prep_file", 1,
         "bad/prep_file/progress.jsonl, line 1: has no text \"file\"; remove the folder and start "
         "again"},
        {eval + "--out bad/eval_settings", 1,
         "bad/eval_settings: was begun with other settings (--coarse-steps was \"unknown\", now "
         "..."},
        {eval + "--out bad/eval_scores", 1,
         "bad/eval_scores: holds scores.jsonl but no settings.json; give another --out"},
    });
}

}  // namespace malformed_input_tests
