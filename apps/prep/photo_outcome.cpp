#include "apps/prep/photo_outcome.h"

#include <algorithm>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "core/error.h"
#include "core/io/json_check.h"
#include "nn/models/codes.h"
#include "render/pose_json.h"

namespace stymo {
namespace {

using Json = nlohmann::json;

/// The members of the codes in the order of `code_names`.
constexpr std::array<std::vector<float> MorphableFit::*, 4> code_members{
    &MorphableFit::identity, &MorphableFit::expression, &MorphableFit::texture,
    &MorphableFit::light};

JsonValue landmarks_json(const Landmarks& landmarks) {
    std::vector<std::vector<double>> points;
    for (const Eigen::Vector2d& point : landmarks) points.push_back({point[0], point[1]});
    return {points};
}

JsonValue to_json(const FaceOutcome& face) {
    JsonValue value = JsonValue::object({{"face", face_record(face, face.fit.pose)},
                                         {"landmark_error", face.fit.landmark_error},
                                         {"was_aligned", face.was_aligned},
                                         {"made_mask", face.made_mask},
                                         {"warnings", face.warnings}});
    if (face.mask_agreement) value.add("mask_agreement", *face.mask_agreement);
    if (face.network_rotation) {
        const auto numbers = face.network_rotation->reshaped<Eigen::RowMajor>();
        value.add("network_rotation", std::vector<double>(numbers.begin(), numbers.end()));
    }
    return value;
}

FaceOutcome parse_face(const Json& value) {
    FaceOutcome face;
    const Json& record = value.at("face");
    face.id = record.at("id").get<std::string>();
    const std::filesystem::path name(face.id);
    if (name.is_absolute() || name.lexically_normal() != name || *name.begin() == "..")
        fail<FileError>("\"id\" holds ", face.id, ", which is no name of a file");
    face.fit.pose = parse_pose(record.at("pose").dump());
    for (std::size_t group = 0; group < code_members.size(); ++group) {
        std::vector<float>& code = face.fit.*code_members[group];
        code = record.at("code").at(code_names[group]).get<std::vector<float>>();
        if (std::ssize(code) != code_sizes[group])
            fail<FileError>("\"", code_names[group], "\" is not an array of ", code_sizes[group],
                            " numbers");
    }
    const auto points = record.at("landmarks").get<std::array<std::array<double, 2>, 68>>();
    std::ranges::transform(points, face.landmarks.begin(),
                           [](const auto& point) { return Eigen::Vector2d(point[0], point[1]); });
    face.fit.landmark_error = value.at("landmark_error").get<double>();
    face.was_aligned = value.at("was_aligned").get<bool>();
    face.made_mask = value.at("made_mask").get<bool>();
    face.origin = {record.value("person", ""), record.value("series", ""),
                   record.value("source", ""), record.value("take", "")};
    face.warnings = value.at("warnings").get<std::vector<std::string>>();
    if (value.contains("mask_agreement"))
        face.mask_agreement = value["mask_agreement"].get<double>();
    if (value.contains("network_rotation")) {
        const auto numbers = value["network_rotation"].get<std::array<double, 9>>();
        face.network_rotation = Eigen::Matrix3d(numbers.data()).transpose();
    }
    return face;
}

}  // namespace

FaceOutcome outcome_of(std::string id, PreparedFace face) {
    return {std::move(id),         std::move(face.fit),      face.crop.landmarks,
            face.network_rotation, face.crop.mask_agreement, face.crop.was_aligned,
            face.crop.made_mask,   std::move(face.warnings), {}};
}

JsonValue face_record(const FaceOutcome& face, const Pose& pose) {
    JsonValue code = JsonValue::object();
    for (std::size_t group = 0; group < code_members.size(); ++group)
        code.add(code_names[group], face.fit.*code_members[group]);
    JsonValue record = JsonValue::object({{"id", face.id},
                                          {"pose", to_json(pose)},
                                          {"code", code},
                                          {"landmarks", landmarks_json(face.landmarks)}});
    const PhotoOrigin& origin = face.origin;
    if (!origin.person.empty()) record.add("person", origin.person);
    if (!origin.series.empty()) record.add("series", origin.series);
    if (!origin.source.empty()) record.add("source", origin.source);
    if (!origin.take.empty()) record.add("take", origin.take);
    return record;
}

JsonValue to_json(const PhotoOutcome& outcome) {
    std::vector<JsonValue> faces;
    for (const FaceOutcome& face : outcome.faces) faces.push_back(to_json(face));
    return JsonValue::object(
        {{"file", outcome.file}, {"failure", outcome.failure}, {"faces", faces}});
}

PhotoOutcome parse_photo_outcome(std::string_view line) {
    try {
        require_sound_json(line);
        const Json value = Json::parse(line);
        PhotoOutcome outcome{
            value.at("file").get<std::string>(), value.at("failure").get<std::string>(), {}};
        for (const Json& face : value.at("faces")) outcome.faces.push_back(parse_face(face));
        return outcome;
    } catch (const Json::exception&) {
        fail<FileError>("not what became of a photo");
    }
}

}  // namespace stymo
