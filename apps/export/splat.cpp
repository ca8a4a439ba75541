#include <zlib.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <memory>
#include <new>
#include <sstream>
#include <string>

#include "apps/common/tool_options.h"
#include "apps/export/commands.h"
#include "core/error.h"
#include "core/io/file.h"
#include "core/progress.h"
#include "core/tensor_eigen.h"
#include "fit/face_splats.h"
#include "nn/models/code_file.h"
#include "render/camera.h"

namespace stymo {

namespace {

/// A splat as the files have it.
struct FileSplat {
    Eigen::Vector3f center, log_scale;
    Eigen::Quaternionf turn;  ///< of the axes that `log_scale` belongs to
    float logit;
    Eigen::Array<float, 12, 1> color;  ///< as in Splats
};

/// The shortest turn from the z axis to a normal.
Eigen::Quaternionf turned_to(const Eigen::Vector3f& normal) {
    constexpr float least = 1e-6F;  // a normal along -z has no shortest turn
    return Eigen::Quaternionf(std::max(1.0F + normal[2], least), -normal[1], normal[0], 0.0F)
        .normalized();
}

FileSplat row_of(const Splats& splats, Eigen::Index i) {
    FileSplat row{.center = metres * matrix_map<float>(splats.centers).row(i).transpose(),
                  .log_scale = Eigen::Vector3f::Constant(matrix_map<float>(splats.sizes)(i, 0) +
                                                         std::log(metres)),
                  .turn = turned_to(matrix_map<float>(splats.normals).row(i).transpose()),
                  .logit = matrix_map<float>(splats.logits)(i, 0),
                  .color = matrix_map<float>(splats.colors).row(i).transpose()};
    row.log_scale[2] += std::log(splat_thickness);
    return row;
}

void append(std::string& bytes, std::uint32_t value, int count = 4) {
    for (int k = 0; k < count; ++k) bytes += static_cast<char>(value >> (8 * k) & 0xFFU);
}
void append(std::string& bytes, float value) {
    append(bytes, std::bit_cast<std::uint32_t>(value));
}
void append_byte(std::string& bytes, float value) {
    bytes += static_cast<char>(std::clamp(std::lround(value), 0L, 255L));
}

std::string gzipped(const std::string& bytes) {
    z_stream stream{};
    constexpr int gzip = 15 + 16, memory = 8;
    std::string result;
    if (deflateInit2(&stream, Z_BEST_COMPRESSION, Z_DEFLATED, gzip, memory, Z_DEFAULT_STRATEGY) !=
        Z_OK)
        throw std::bad_alloc();
    result.resize(deflateBound(&stream, bytes.size()));
    stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(bytes.data()));  // zlib reads only
    stream.avail_in = static_cast<uInt>(bytes.size());
    stream.next_out = reinterpret_cast<Bytef*>(result.data());
    stream.avail_out = static_cast<uInt>(result.size());
    deflate(&stream, Z_FINISH);  // into a buffer that is large enough, so it ends
    result.resize(stream.total_out);
    deflateEnd(&stream);
    return result;
}

/// PLY with the columns of Kerbl et al. 2023, and their axes: y down, the face looking along -z.
void write_splat_ply(const std::filesystem::path& path, const Splats& splats) {
    const Eigen::Index count = splats.centers.shape(0);
    std::string bytes = "ply\nformat binary_little_endian 1.0\ncomment stymo\nelement vertex " +
                        std::to_string(count) + '\n';
    const auto declare = [&](const std::string& name, int first, int end) {
        for (int k = first; k < end; ++k)
            bytes += "property float " + name + std::to_string(k) + '\n';
    };
    for (const char* const name : {"x", "y", "z", "nx", "ny", "nz"})
        bytes += std::string("property float ") + name + '\n';
    declare("f_dc_", 0, 3);
    declare("f_rest_", 0, 9);
    bytes += "property float opacity\n";
    declare("scale_", 0, 3);
    declare("rot_", 0, 4);
    bytes += "end_header\n";
    // Half a turn about x: y and z change sign, and so do their harmonics.
    const Eigen::Quaternionf half(0.0F, 1.0F, 0.0F, 0.0F);
    constexpr std::array signs{1.0F, -1.0F, -1.0F, 1.0F};
    for (Eigen::Index i = 0; i < count; ++i) {
        const FileSplat row = row_of(splats, i);
        const Eigen::Quaternionf turn = half * row.turn;
        const Eigen::Vector3f center = half * row.center, normal = turn * Eigen::Vector3f::UnitZ();
        for (const float value : center) append(bytes, value);
        for (const float value : normal) append(bytes, value);
        for (Eigen::Index channel = 0; channel < 3; ++channel) append(bytes, row.color[channel]);
        for (Eigen::Index channel = 0; channel < 3; ++channel)
            for (Eigen::Index k = 1; k < 4; ++k)
                append(bytes, signs[static_cast<std::size_t>(k)] * row.color[3 * k + channel]);
        append(bytes, row.logit);
        for (const float value : row.log_scale) append(bytes, value);
        for (const float value : {turn.w(), turn.x(), turn.y(), turn.z()}) append(bytes, value);
    }
    write_file(path, bytes, Durability::none);
}

/// SPZ, version 2 (Niantic): y up, the face looking along +z; about a fifth of the size.
void write_spz(const std::filesystem::path& path, const Splats& splats) {
    constexpr std::uint32_t magic = 0x5053474E, version = 2, harmonics_degree = 1;
    constexpr std::uint32_t fraction_bits = 20;  // a micrometre, up to 8 m
    const Eigen::Index count = splats.centers.shape(0);
    std::string positions, alphas, colors, scales, turns, harmonics;
    for (Eigen::Index i = 0; i < count; ++i) {
        const FileSplat row = row_of(splats, i);
        for (const float value : row.center)
            append(positions,
                   static_cast<std::uint32_t>(std::lround(std::ldexp(value, fraction_bits))), 3);
        append_byte(alphas, 255.0F / (1.0F + std::exp(-row.logit)));
        for (Eigen::Index k = 0; k < 3; ++k)
            append_byte(colors, 255.0F * (0.5F + 0.15F * row.color[k]));
        for (const float value : row.log_scale) append_byte(scales, 16.0F * (value + 10.0F));
        const float sign = row.turn.w() < 0.0F ? -1.0F : 1.0F;
        for (const float value : {row.turn.x(), row.turn.y(), row.turn.z()})
            append_byte(turns, 127.5F * (1.0F + sign * value));
        for (Eigen::Index k = 3; k < 12; ++k)
            append_byte(harmonics, 128.0F * (1.0F + row.color[k]));
    }
    std::string bytes;
    for (const std::uint32_t word : {magic, version, static_cast<std::uint32_t>(count),
                                     harmonics_degree | fraction_bits << 8U})
        append(bytes, word);
    for (const std::string* const part :
         {&positions, &alphas, &colors, &scales, &turns, &harmonics})
        bytes += *part;
    write_file(path, gzipped(bytes), Durability::none);
}

struct SplatOptions {
    ModelOptions model;
    std::filesystem::path codes, out, check;
    std::int64_t count = 100'000;
};

AppResult export_splats(const SplatOptions& options) {
    require_extension(options.out, {".ply", ".spz"});
    if (!options.check.empty()) require_extension(options.check, {".png", ".jpg"});
    const Codes codes = read_own_codes(options.codes, options.model).codes;
    const Model model = load_model(options.model, ModelParts::decoder);
    for (const std::filesystem::path& file : {options.out, options.check})
        if (!file.empty()) require_folder_of(file);
    Splats splats;
    try {
        Progress progress({.title = "splats", .total = 100});
        splats = face_splats(model, codes, options.count, [&](double done) {
            progress.update(static_cast<std::int64_t>(100.0 * done));
        });
    } catch (const Error& error) {
        fail<ValueError>(options.codes.string(), ": ", error.what());
    }
    (options.out.extension() == ".ply" ? write_splat_ply : write_spz)(options.out, splats);
    std::ostringstream text;
    text << options.out.string() << '\n';
    JsonValue json =
        JsonValue::object({{"written", options.out.string()}, {"splats", splats.centers.shape(0)}});
    if (!options.check.empty())
        check_against_frames(
            options.check, model, codes,
            [&](const Camera& camera, std::int64_t side) {
                return rendered_splats(splats, camera, side);
            },
            text, json);
    return {text.str(), json};
}

}  // namespace

void declare_splat(CommandLine& line) {
    const auto options = std::make_shared<SplatOptions>();
    Command command =
        line.command("splat", "Writes a fitted face as 3D Gaussians, which viewers of splats open.",
                     [options](const CommonOptions&) { return export_splats(*options); });
    declare_model(command, options->model);
    declare_tuned(command, options->model);
    command.option("--codes", options->codes, "codes.json of a fit").required();
    command.option("--out", options->out, ".ply, or .spz, which is smaller").required();
    command.option("--count", options->count, "about this many splats").range(1000, 1'000'000);
    command.option(
        "--check", options->check,
        "also measure the splats against the model's frames, and write both as a picture");
}

}  // namespace stymo
