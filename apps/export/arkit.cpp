#include <filesystem>
#include <iomanip>
#include <memory>
#include <sstream>

#include "apps/common/coefficient_files.h"
#include "apps/common/table.h"
#include "apps/common/tool_options.h"
#include "apps/export/commands.h"
#include "core/io/file.h"
#include "nn/models/code_file.h"
#include "render/camera.h"

namespace stymo {

namespace {

struct ArkitOptions {
    std::filesystem::path codes, coefficients, out, morphable;
};

constexpr double millimetres = 1000.0 * double{metres};  ///< in a world unit

std::span<const float> expression_of(const CodeFile& face) {
    return face.codes.expression().value().values<float>();
}

JsonValue object_of(const std::vector<double>& coefficients) {
    JsonValue json = JsonValue::object();
    for (std::size_t k = 0; k < arkit_names.size(); ++k) json.add(arkit_names[k], coefficients[k]);
    return json;
}

/// What the head can do, with the coefficients of one moment.
std::string table(const ArkitShapes& shapes, const std::vector<double>& coefficients) {
    std::ostringstream text;
    text << std::fixed << std::setprecision(3);
    for (std::size_t k = 0; k < arkit_names.size(); ++k)
        text << std::left << std::setw(21) << arkit_names[k] << std::right << std::setw(6)
             << coefficients[k] << "  " << std::left << std::setw(10) << name_of(shapes.source[k])
             << shapes.recipe[k] << '\n';
    return text.str();
}

/// Errors of conversions, in millimetres of the vertices, root mean square.
struct Errors {
    double size, there, back;
};

std::string sentence(const Errors& errors) {
    return text_from("the expression moves the head's vertices by ", decimal(errors.size, 3),
                     " mm (root mean square); the coefficients miss it by ",
                     decimal(errors.there, 3), " mm, the code of these coefficients by ",
                     decimal(errors.back, 3), " mm\n");
}

JsonValue to_json(const Errors& errors) {
    return JsonValue::object({{"expression_mm", errors.size},
                              {"coefficients_miss_mm", errors.there},
                              {"round_trip_misses_mm", errors.back}});
}

/// Codes -> coefficients.
AppResult to_coefficients(const ArkitOptions& options, const ArkitConversion& conversion,
                          const CodeFile& face) {
    const std::span<const float> code = expression_of(face);
    const std::vector<double> coefficients = conversion.coefficients(code);
    std::vector<float> back = conversion.code(coefficients);
    for (std::size_t i = 0; i < back.size(); ++i) back[i] -= code[i];
    const Errors errors{millimetres * conversion.size(code),
                        millimetres * conversion.difference(code, coefficients),
                        millimetres * conversion.size(back)};
    const JsonValue json =
        JsonValue::object({{"coefficients", object_of(coefficients)}, {"errors", to_json(errors)}});
    const Pose& pose = face.pose;
    write_file(options.out,
               options.out.extension() == ".csv"
                   ? live_link_csv({coefficients, {pose.yaw, pose.pitch, pose.roll}})
                   : json.text() + "\n",
               Durability::none);
    return {table(conversion.shapes(), coefficients) + sentence(errors), json};
}

/// Coefficients -> codes: the face with the expression of each row.
AppResult to_codes(const ArkitOptions& options, const ArkitConversion& conversion, CodeFile face) {
    const std::vector<ArkitMoment> rows = read_coefficients(options.coefficients);
    const bool one = options.out.extension() == ".json";
    if (one && rows.size() > 1)
        fail<UsageError>(options.coefficients.string(), " has ", rows.size(),
                         " rows; give a .jsonl file as --out");
    std::string text;
    Errors worst{};
    for (const auto& [row, view] : rows) {
        const std::vector<float> code = conversion.code(row);
        const double missed = millimetres * conversion.difference(code, row);
        if (missed >= worst.there) {
            worst.there = missed;
            worst.size = millimetres * conversion.size(code);
        }
        face.codes.groups[1] =
            Variable(Tensor::from({1, std::ssize(code)}, std::span<const float>(code)));
        text += code_file_text(face.codes, 0, face.pose, face.model);
    }
    write_file(options.out, text, Durability::none);
    return {
        text_from(options.out.string(), ": ", rows.size(), rows.size() == 1 ? " face" : " faces",
                  "; at worst the code misses the shapes by ", decimal(worst.there, 3), " mm of ",
                  decimal(worst.size, 3),
                  " mm. These codes move the linear head; few of them are faces that the model can "
                  "draw, so drive a face with stymo-drive --coefficients\n"),
        JsonValue::object({{"written", options.out.string()},
                           {"faces", rows.size()},
                           {"worst_miss_mm", worst.there}})};
}

AppResult export_arkit(const ArkitOptions& options) {
    const bool reads = !options.coefficients.empty();
    if (reads) {
        require_extension(options.out, {".json", ".jsonl"});
        require_extension(options.coefficients, {".csv", ".json"});
    } else {
        require_extension(options.out, {".json", ".csv"});
    }
    require_not_read(options.out, {options.codes, options.coefficients});
    const CodeFile face = read_code_file(options.codes);
    const ArkitConversion conversion = arkit_conversion(options.morphable);
    require_folder_of(options.out);
    return reads ? to_codes(options, conversion, face) : to_coefficients(options, conversion, face);
}

}  // namespace

void declare_arkit(CommandLine& line) {
    const auto options = std::make_shared<ArkitOptions>();
    Command command = line.command(
        "arkit",
        "Converts the expression of a face to coefficients of ARKit's 52 shapes, or, with "
        "--coefficients, back.",
        [options](const CommonOptions&) { return export_arkit(*options); });
    command.option("--codes", options->codes, "codes.json of a fit").required();
    command.option("--coefficients", options->coefficients,
                   "CSV of Live Link Face or .json: --codes gets these expressions instead");
    command
        .option("--out", options->out,
                "coefficients: .json, or .csv as Live Link Face writes it; with --coefficients "
                "codes: .json, or .jsonl with a line for each row")
        .required();
    declare_head(command, options->morphable, "whose expressions the codes are");
}

}  // namespace stymo
