#include "render/morphable/arkit_shapes.h"

#include <algorithm>
#include <map>
#include <sstream>
#include <string_view>
#include <vector>

#include "core/tensor_eigen.h"
#include "render/morphable/skin_surface.h"

namespace stymo {

namespace {

/// An expression of a head and its code. In the table, "_S" ends in _L or _R as the shape does.
struct Ingredient {
    std::string expression;
    double code;
};
using Ingredients = std::vector<Ingredient>;

/// The built-in head. Pairs stand without their side.
const std::map<std::string_view, Ingredients>& builtin_recipes() {
    static const std::map<std::string_view, Ingredients> recipes{
        {"eyeBlink", {{"eyeBlink_S", 4.5}}},
        {"eyeLookDown", {{"gazeUp", -4.0}}},
        {"eyeLookUp", {{"gazeUp", 4.0}}},
        {"eyeLookInLeft", {{"gazeLeft", -2.5}}},
        {"eyeLookOutLeft", {{"gazeLeft", 2.5}}},
        {"eyeLookInRight", {{"gazeLeft", 2.5}}},
        {"eyeLookOutRight", {{"gazeLeft", -2.5}}},
        {"eyeSquint", {{"eyeBlink_S", 1.5}, {"cheekSquint", 2.0}}},
        {"eyeWide", {{"eyeBlink_S", -1.5}}},  // beyond what the head's codes do
        {"jawForward", {{"jawForward", 3.0}}},
        {"jawRight", {{"jawLeft", -3.0}}},
        {"jawLeft", {{"jawLeft", 3.0}}},
        {"jawOpen", {{"jawOpen", 4.0}}},
        {"mouthFunnel", {{"mouthPucker", 1.5}, {"mouthUpperUp", 1.5}, {"mouthLowerDown", 1.5}}},
        {"mouthPucker", {{"mouthPucker", 3.0}}},
        {"mouthRight", {{"mouthLeft", -3.0}}},
        {"mouthLeft", {{"mouthLeft", 3.0}}},
        {"mouthSmile", {{"mouthSmile_S", 3.0}}},
        {"mouthFrown", {{"mouthSmile_S", -2.0}}},
        {"mouthStretch", {{"mouthPucker", -2.0}}},
        {"mouthShrugLower", {{"mouthShrugLower", 2.5}}},
        {"mouthPress", {{"lipsFull", -2.0}}},
        {"mouthLowerDown", {{"mouthLowerDown", 2.0}}},
        {"mouthUpperUp", {{"mouthUpperUp", 2.0}}},
        {"browDown", {{"browRaise_S", -1.5}, {"browKnit", 1.5}}},
        {"browInnerUp", {{"browInnerUp", 2.5}}},
        {"browOuterUp", {{"browOuterUp", 2.5}}},
        {"cheekPuff", {{"cheekPuff", 2.5}}},
        {"cheekSquint", {{"cheekSquint", 2.0}}},
        {"noseSneer", {{"noseSneer", 2.5}}},
    };
    return recipes;
}

/// A shape's name without its side, if it belongs to a pair of one for each half of the face.
struct PairedName {
    std::string stem;
    char side = ' ';  ///< L or R, or a space
};

PairedName paired(const std::string& name) {
    const bool moves_sideways = name.starts_with("jaw") || name.size() <= 10;  // mouthRight
    for (const char* ending : {"Left", "Right"})
        if (name.ends_with(ending) && !moves_sideways)
            return {name.substr(0, name.size() - std::string_view(ending).size()), ending[0]};
    return {name};
}

Ingredients recipe_of(const MorphableHead& head, const std::string& name) {
    const PairedName shape = paired(name);
    const auto has = [&](const std::string& expression) {
        return std::ranges::find(head.expression_names, expression) != head.expression_names.end();
    };
    if (head.grid_uv.defined()) {
        const auto& recipes = builtin_recipes();
        auto found = recipes.find(name);
        if (found == recipes.end()) found = recipes.find(shape.stem);
        if (found == recipes.end()) return {};
        Ingredients result = found->second;
        for (Ingredient& part : result)
            if (part.expression.ends_with("_S")) part.expression.back() = shape.side;
        return result;
    }
    constexpr double full_strength = 4.0;
    const std::string with_side =
        shape.side == ' ' ? name : shape.stem + "_" + std::string(1, shape.side);
    for (const std::string& same : {name, with_side})
        if (has(same)) return {{same, full_strength}};
    if (shape.side == ' ' && has(name + "_L") && has(name + "_R"))
        return {{name + "_L", full_strength}, {name + "_R", full_strength}};
    return {};
}

bool has_side(const std::string& expression) {
    return expression.ends_with("_L") || expression.ends_with("_R");
}

std::string without_side(const std::string& expression) {
    return has_side(expression) ? expression.substr(0, expression.size() - 2) : expression;
}

}  // namespace

const char* name_of(ArkitSource source) {
    constexpr std::array names{"exact", "composed", "missing"};
    return names[static_cast<std::size_t>(source)];
}

ArkitShapes arkit_shapes(const MorphableHead& head) {
    ArkitShapes shapes;
    const std::int64_t count = head.vertex_count();
    shapes.displacement = Tensor::zeros({std::ssize(arkit_names), count, 3});
    auto rows = mutable_matrix_map<float>(shapes.displacement);
    const auto mean = matrix_map<float>(head.mean);
    const auto expressions = matrix_map<float>(head.expression);
    for (std::size_t k = 0; k < arkit_names.size(); ++k) {
        const std::string name = arkit_names[k];
        const Ingredients recipe = recipe_of(head, name);
        const char side = paired(name).side;
        std::ostringstream text;
        bool is_half = false;
        for (const Ingredient& part : recipe) {
            const auto row = std::ranges::find(head.expression_names, part.expression) -
                             head.expression_names.begin();
            const bool half = side != ' ' && !has_side(part.expression) && part.expression != name;
            is_half = is_half || half;
            text << (text.tellp() > 0 ? " + " : "") << part.code << ' ' << part.expression;
            for (std::int64_t v = 0; v < count; ++v) {
                // The halves of an expression add up to it.
                constexpr double blend = 0.06;
                const auto x = static_cast<double>(mean(v, 0));
                const double left = morphable::smooth_step(-blend, blend, x);
                const double share = !half ? 1.0 : side == 'L' ? left : 1.0 - left;
                rows.row(static_cast<Eigen::Index>(k) * count + v) +=
                    float(share * part.code) * expressions.row(row * count + v);
            }
        }
        if (is_half) text << (side == 'L' ? ", left half" : ", right half");
        shapes.recipe[k] = text.str();
        const bool same_name = recipe.size() == 1 && !is_half &&
                               without_side(recipe[0].expression) == paired(name).stem;
        shapes.source[k] = recipe.empty() ? ArkitSource::missing
                           : same_name    ? ArkitSource::exact
                                          : ArkitSource::composed;
    }
    return shapes;
}

}  // namespace stymo
