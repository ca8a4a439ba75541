#include <algorithm>
#include <cmath>
#include <iomanip>
#include <iostream>
#include <map>
#include <numeric>
#include <optional>
#include <sstream>

#include "apps/eval/commands.h"
#include "apps/eval/evaluate.h"
#include "core/error.h"
#include "core/progress.h"

namespace stymo {

namespace {

using Rows = std::vector<std::vector<double>>;

/// Rows of unit length, after each column got the mean 0 and the variance 1.
Rows standardised(Rows rows) {
    for (std::size_t column = 0; column < rows.front().size(); ++column) {
        double sum = 0.0, squares = 0.0;
        for (const auto& row : rows) sum += row[column];
        const double mean = sum / static_cast<double>(rows.size());
        for (const auto& row : rows) squares += (row[column] - mean) * (row[column] - mean);
        const double deviation = std::sqrt(squares / static_cast<double>(rows.size())) + 1e-12;
        for (auto& row : rows) row[column] = (row[column] - mean) / deviation;
    }
    for (auto& row : rows) {
        const double length =
            std::sqrt(std::inner_product(row.begin(), row.end(), row.begin(), 0.0)) + 1e-12;
        for (double& value : row) value /= length;
    }
    return rows;
}

/// What a photo's likeness to all others says.
struct Likeness {
    double least_same = 2.0;  ///< to the most different photo of the same person
    double most_same = -2.0;
    double most_other = -2.0;  ///< to the most similar photo of somebody else
    std::size_t other = 0;     ///< that photo
};

}  // namespace

PeopleScore people_score(const Rows& codes, const std::vector<std::string>& people) {
    std::map<std::string, std::int64_t> counts;
    for (const std::string& person : people)
        if (!person.empty()) ++counts[person];
    std::erase_if(counts, [](const auto& entry) { return entry.second < 2; });
    if (counts.empty()) fail<ValueError>("no person has two photos");

    const Rows rows = standardised(codes);
    PeopleScore score;
    score.people = std::ssize(counts);
    std::map<std::string, bool> apart;
    double same_pairs = 0.0, other_pairs = 0.0;
    for (std::size_t i = 0; i < rows.size(); ++i) {
        if (!counts.contains(people[i])) continue;
        Likeness likeness;
        for (std::size_t j = 0; j < rows.size(); ++j) {
            if (j == i) continue;
            const double cosine =
                std::inner_product(rows[i].begin(), rows[i].end(), rows[j].begin(), 0.0);
            const bool same = people[j] == people[i];
            // A pair is met twice if both people have several photos.
            const double weight = counts.contains(people[j]) ? 1.0 : 2.0;
            if (same) {
                score.same_cosine += cosine;
                same_pairs += 1.0;
            } else if (!people[j].empty()) {
                score.other_cosine += weight * cosine;
                other_pairs += weight;
            }
            if (same) {
                likeness.least_same = std::min(likeness.least_same, cosine);
                likeness.most_same = std::max(likeness.most_same, cosine);
            } else if (cosine > likeness.most_other) {
                likeness.most_other = cosine;
                likeness.other = j;
            }
        }
        ++score.photos;
        const bool right = likeness.most_same > likeness.most_other;
        score.nearest += right ? 1.0 : 0.0;
        if (!right) score.doubtful.emplace_back(i, likeness.other);
        const bool is_apart = likeness.least_same > likeness.most_other;
        apart[people[i]] = is_apart && (!apart.contains(people[i]) || apart[people[i]]);
    }
    if (score.people == 1 && score.photos == std::ssize(rows))
        fail<ValueError>("all photos show one person: there is nobody else to compare with");
    score.nearest /= static_cast<double>(score.photos);
    score.apart = static_cast<double>(std::ranges::count_if(
                      apart, [](const auto& entry) { return entry.second; })) /
                  static_cast<double>(score.people);
    score.same_cosine /= same_pairs;
    score.other_cosine /= std::max(other_pairs, 1.0);
    return score;
}

AppResult evaluate_people(const PeopleOptions& options) {
    if (options.data.empty()) fail<UsageError>("--data is required");
    const Model model = load_model(options.model, ModelParts::all);
    if (!model.has_encoder())
        fail<ValueError>(model_file(options.model).string(), ": has no encoder");
    DataConfig data;
    data.cache_megabytes = 0;
    const Dataset faces(options.data, model.config().decoder.resolution, data, Split::all,
                        model.config().camera);
    std::vector<std::string> ids, people;
    Rows codes;
    const std::vector<std::int64_t> positions = positions_of(faces, parse_range(options.ids));
    Progress progress({.title = "people", .total = std::ssize(positions), .unit = "photos"});
    for (const std::int64_t i : positions) {
        std::optional<Face> face;
        try {
            face = faces.load_exactly(i);
        } catch (const Error& error) {
            std::cerr << "skipped " << faces.files(i).id << ": " << error.what() << std::endl;
            continue;
        }
        const Codes first =
            uncorrected_codes(model, make_batch({&*face, 1}, model.decoder().ladder().smallest()));
        std::vector<double> row = first.identity().value().to_vector();
        const std::vector<double> texture = first.texture().value().to_vector();
        row.insert(row.end(), texture.begin(), texture.end());
        codes.push_back(std::move(row));
        ids.push_back(face->id);
        const FaceEntry* const entry = faces.entry(i);
        people.push_back(entry == nullptr ? "" : entry->origin.person);
        progress.update(std::ssize(people));
    }
    const PeopleScore score = people_score(codes, people);

    std::ostringstream text;
    text << score.photos << " photos of " << score.people << " people: the nearest photo by "
         << "identity and texture shows the same person for " << std::fixed << std::setprecision(1)
         << 100.0 * score.nearest << " %; " << 100.0 * score.apart
         << " % of the people are apart from all others\n"
         << std::setprecision(3) << "cosine of two photos of one person " << score.same_cosine
         << ", of two people " << score.other_cosine << '\n';
    std::vector<JsonValue> doubtful;
    constexpr std::size_t named = 10;
    for (const auto& [photo, other] : score.doubtful) {
        if (doubtful.size() < named)
            text << ids[photo] << " (" << people[photo] << ") is nearest to " << ids[other]
                 << (people[other].empty() ? "" : " (" + people[other] + ")") << '\n';
        doubtful.push_back(JsonValue::object({{"id", ids[photo]}, {"nearest", ids[other]}}));
    }
    if (doubtful.size() > named) text << "and " << doubtful.size() - named << " more\n";
    return {text.str(), JsonValue::object({{"photos", score.photos},
                                           {"people", score.people},
                                           {"nearest", score.nearest},
                                           {"apart", score.apart},
                                           {"same_cosine", score.same_cosine},
                                           {"other_cosine", score.other_cosine},
                                           {"doubtful", doubtful}})};
}

}  // namespace stymo
