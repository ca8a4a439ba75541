#include <array>
#include <filesystem>
#include <iomanip>
#include <memory>
#include <sstream>
#include <vector>

#include "apps/common/tool_options.h"
#include "apps/edit/commands.h"
#include "core/interrupt.h"
#include "core/ops/ops.h"
#include "core/progress.h"
#include "fit/edit/style_mix.h"
#include "nn/models/model.h"
#include "nn/realtime/view.h"
#include "render/morphable/head_source.h"
#include "train/data/synthetic_faces.h"

namespace stymo {

namespace {

struct DisentangleOptions {
    ModelOptions model;
    std::filesystem::path morphable;
    std::int64_t pairs = 64;
};

constexpr std::size_t group_count = code_names.size();

CodeGroups only(std::size_t group) {
    CodeGroups taken{};
    taken[group] = true;
    return taken;
}

/// The head `face` with one group of `other`, from the same side.
SyntheticFace with_group(SyntheticFace face, const SyntheticFace& other, std::size_t group) {
    if (group == 0) face.identity = other.identity;
    if (group == 1) face.expression = other.expression;
    if (group == 2) face.texture = other.texture;
    if (group == 3) face.light = other.light;
    return face;
}

/// The encoder's codes of a face, of another face, and of the face with each group of the other.
struct Read {
    Codes base;
    Codes other;
    std::array<Codes, group_count> changed;
};

/// Encodes images one after the other and keeps the codes of each kind.
class Reader {
public:
    Reader(const Model& model, const MorphableHead& head) : model_(model), head_(head) {}

    [[nodiscard]] Read drawn(const SyntheticFace& face, SyntheticFace other) const {
        other.pose = face.pose;
        Read read{of_head(face), of_head(other), {}};
        for (std::size_t group = 0; group < group_count; ++group)
            read.changed[group] = of_head(with_group(face, other, group));
        return read;
    }

    /// The decoder's images of the encoder's codes of two synthetic heads.
    [[nodiscard]] Read decoded(const Read& drawn, const Pose& pose) const {
        const Camera camera = camera_from_pose(pose, model_.config().camera.intrinsics);
        Read read{of_codes(drawn.base, camera), of_codes(drawn.other, camera), {}};
        for (std::size_t group = 0; group < group_count; ++group)
            read.changed[group] = of_codes(mix_codes(drawn.base, drawn.other, only(group)), camera);
        return read;
    }

private:
    [[nodiscard]] Codes of_head(const SyntheticFace& face) const {
        const std::int64_t side = model_.config().decoder.resolution;
        const Tensor image =
            render_synthetic_face(head_, face, model_.config().camera.intrinsics, side).color;
        return codes_of_image(image);
    }
    [[nodiscard]] Codes of_codes(const Codes& codes, const Camera& camera) const {
        const ViewOptions options{.samples_per_ray =
                                      model_.config().reconstruction.fit_samples_per_ray};
        return codes_of_image(render_view(model_, codes, 0, camera, options).image);
    }
    /// The encoder's codes of an image in [0, 1].
    [[nodiscard]] Codes codes_of_image(const Tensor& image) const {
        const Shape one{1, image.shape(0), image.shape(1), 3};
        return detached(model_.encoder()(Variable(image.reshaped(one)) * 2.0 - 1.0));
    }

    const Model& model_;
    const MorphableHead& head_;
};

Codes stacked(const std::vector<Read>& reads,
              const std::function<const Codes&(const Read&)>& kind) {
    Codes result;
    for (std::size_t group = 0; group < group_count; ++group) {
        std::vector<Variable> rows;
        for (const Read& read : reads) rows.push_back(kind(read).groups[group]);
        result.groups[group] = concat(rows, 0);
    }
    return result;
}

GroupMatrix movements_of(const std::vector<Read>& reads) {
    std::array<Codes, group_count> changed;
    for (std::size_t group = 0; group < group_count; ++group)
        changed[group] = stacked(
            reads, [group](const Read& read) -> const Codes& { return read.changed[group]; });
    return group_movements(
        stacked(reads, [](const Read& read) -> const Codes& { return read.base; }),
        stacked(reads, [](const Read& read) -> const Codes& { return read.other; }), changed);
}

JsonValue to_json(const GroupMatrix& movements) {
    const std::array<double, group_count> leaks = largest_leaks(movements);
    JsonValue json = JsonValue::object();
    for (std::size_t row = 0; row < group_count; ++row) {
        JsonValue read = JsonValue::object();
        for (std::size_t column = 0; column < group_count; ++column)
            read.add(code_names[column], movements[row][column]);
        read.add("largest_leak", leaks[row]);
        json.add(code_names[row], read);
    }
    return json;
}

std::string table(const char* title, const GroupMatrix& movements) {
    const std::array<double, group_count> leaks = largest_leaks(movements);
    std::ostringstream text;
    text << title << "\nreplaced  read:";
    for (const char* name : code_names) text << std::setw(8) << name;
    text << "  largest leak\n" << std::fixed << std::setprecision(3);
    for (std::size_t row = 0; row < group_count; ++row) {
        text << std::left << std::setw(15) << code_names[row] << std::right;
        for (const double value : movements[row]) text << std::setw(8) << value;
        text << std::setw(14) << leaks[row] << '\n';
    }
    return text.str();
}

AppResult disentangle(const DisentangleOptions& options, std::uint64_t seed) {
    const Model model = load_model(options.model);
    const MorphableHead head = morphable_head_from(options.morphable);
    const Reader reader(model, head);
    const Rng rng = Rng(seed).split("disentangle");
    std::vector<Read> drawn;
    std::vector<Read> decoded;
    const InterruptGuard guard;
    Progress progress({.title = "disentangle", .total = options.pairs, .unit = "pairs"});
    for (std::int64_t pair = 0; pair < options.pairs; ++pair) {
        if (interrupted()) fail<Error>("interrupted; nothing was measured");
        const auto number = static_cast<std::uint64_t>(2 * pair);
        const SyntheticFace face = sample_synthetic_face(head, rng.split(number));
        drawn.push_back(reader.drawn(face, sample_synthetic_face(head, rng.split(number + 1))));
        decoded.push_back(reader.decoded(drawn.back(), face.pose));
        progress.update(pair + 1);
    }
    progress.finish();
    const GroupMatrix of_decoded = movements_of(decoded);
    const GroupMatrix of_drawn = movements_of(drawn);
    return {table("decoded faces", of_decoded) + table("drawn heads", of_drawn),
            JsonValue::object({{"pairs", options.pairs},
                               {"decoded", to_json(of_decoded)},
                               {"drawn", to_json(of_drawn)}})};
}

}  // namespace

void declare_disentangle(CommandLine& line) {
    const auto options = std::make_shared<DisentangleOptions>();
    Command command = line.command(
        "disentangle",
        "Measures on pairs of synthetic heads how far each group of the encoder's codes moves when "
        "one group is replaced, relative to the movement when all groups are: in images of "
        "the "
        "decoder and in renderings of the heads.",
        [options](const CommonOptions& common) { return disentangle(*options, common.seed); });
    declare_model(command, options->model);
    command.option("--pairs", options->pairs, "pairs of random heads").range(1, 1e6);
    declare_head(command, options->morphable, "");
}

}  // namespace stymo
