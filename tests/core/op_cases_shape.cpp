#include "core/op_cases.h"
#include "core/ops/ops.h"

namespace stymo::test {
namespace {

Index moved(Index index, std::size_t axis, std::int64_t position) {
    index[axis] = position;
    return index;
}

Array permuted(const Array& x, const std::vector<std::size_t>& order) {
    std::vector<std::int64_t> extents;
    for (const std::size_t axis : order) extents.push_back(x.extents[axis]);
    return generate(extents, [&](const Index& i) {
        Index source(i.size());
        for (std::size_t axis = 0; axis < order.size(); ++axis) source[order[axis]] = i[axis];
        return x.at(source);
    });
}

void add_permutations(std::vector<OpCase>& rows) {
    struct Form {
        const char* name;
        Shape shape;
        std::vector<int> order;
        Shape speed;
    };
    const std::vector<Form> forms{{"rotate", {2, 3, 4}, {2, 0, 1}, {64, 64, 256}},
                                  {"image to planes", {2, 2, 3, 4}, {0, 3, 1, 2}, {4, 64, 64, 64}},
                                  {"swap the first two", {3, 2, 4}, {1, 0, 2}, {64, 64, 256}}};
    for (const Form& form : forms) {
        const std::vector<std::size_t> order(form.order.begin(), form.order.end());
        rows.push_back({"permute",
                        form.name,
                        {{form.shape}},
                        [form](const auto& x) { return permute(x[0], form.order); },
                        [order](const std::vector<Array>& x) { return permuted(x[0], order); },
                        {form.speed}});
    }
    rows.push_back({"transpose",
                    "matrix",
                    {{{3, 4}}},
                    [](const auto& x) { return transpose(x[0]); },
                    [](const std::vector<Array>& x) {
                        return permuted(x[0], {1, 0});
                    },
                    {{1024, 1024}}});
    rows.push_back({"transpose",
                    "batch",
                    {{{2, 3, 4}}},
                    [](const auto& x) { return transpose(x[0]); },
                    [](const std::vector<Array>& x) {
                        return permuted(x[0], {0, 2, 1});
                    }});
}

void add_axis_cases(std::vector<OpCase>& rows) {
    for (const int axis : {0, 1, -1}) {
        const std::size_t along = axis < 0 ? 2 : static_cast<std::size_t>(axis);
        const std::string form = "axis " + std::to_string(axis);
        rows.push_back({"flip",
                        form,
                        {{{2, 3, 4}}},
                        [axis](const auto& x) { return flip(x[0], axis); },
                        [along](const std::vector<Array>& x) {
                            return generate(x[0].extents, [&](const Index& i) {
                                return x[0].at(moved(i, along, x[0].extents[along] - 1 - i[along]));
                            });
                        },
                        {{64, 64, 256}}});
        rows.push_back(
            {"slice",
             form,
             {{{4, 3, 5}}},
             [axis](const auto& x) { return slice(x[0], axis, 1, x[0].shape(axis) - 1); },
             [along](const std::vector<Array>& x) {
                 auto extents = x[0].extents;
                 extents[along] -= 2;
                 return generate(extents, [&](const Index& i) {
                     return x[0].at(moved(i, along, i[along] + 1));
                 });
             },
             {{64, 64, 256}}});
        rows.push_back({"pad",
                        form,
                        {{{2, 3, 2}}},
                        [axis](const auto& x) { return pad(x[0], axis, 1, 2); },
                        [along](const std::vector<Array>& x) {
                            auto extents = x[0].extents;
                            extents[along] += 3;
                            return generate(extents, [&](const Index& i) {
                                const std::int64_t source = i[along] - 1;
                                const bool inside = source >= 0 && source < x[0].extents[along];
                                return inside ? x[0].at(moved(i, along, source)) : 0.0;
                            });
                        },
                        {{64, 64, 256}}});
    }
}

OpCase concatenation(const char* form, int axis, const std::vector<Shape>& shapes,
                     const std::vector<Shape>& speed) {
    const std::size_t along = axis < 0 ? 1 : static_cast<std::size_t>(axis);
    OpCase row{"concat",
               form,
               {},
               [axis](const auto& x) { return concat(x, axis); },
               [along](const std::vector<Array>& x) {
                   auto extents = x[0].extents;
                   extents[along] = 0;
                   for (const Array& part : x) extents[along] += part.extents[along];
                   return generate(extents, [&](const Index& i) {
                       std::int64_t rest = i[along];
                       std::size_t part = 0;
                       while (rest >= x[part].extents[along]) rest -= x[part++].extents[along];
                       return x[part].at(moved(i, along, rest));
                   });
               },
               speed};
    for (const Shape& shape : shapes) row.inputs.push_back({shape});
    return row;
}

Array repeated(const Array& x, const std::vector<std::int64_t>& extents) {
    return generate(extents, [&](const Index& i) { return x.broadcast_at(i); });
}

}  // namespace

std::vector<OpCase> shape_cases() {
    std::vector<OpCase> rows;
    rows.push_back({"reshape",
                    "given shape",
                    {{{2, 6}}},
                    [](const auto& x) {
                        return reshape(x[0], Shape{x[0].shape(1), x[0].shape(0)});
                    },
                    [](const std::vector<Array>& x) {
                        return Array{{x[0].extents[1], x[0].extents[0]}, x[0].values};
                    },
                    {{4096, 256}}});
    rows.push_back({"reshape",
                    "one extent left open",
                    {{{2, 6}}},
                    [](const auto& x) {
                        return reshape(x[0], {2, -1, 2});
                    },
                    [](const std::vector<Array>& x) {
                        return Array{{2, 3, 2}, x[0].values};
                    }});
    add_permutations(rows);
    add_axis_cases(rows);
    rows.push_back(
        concatenation("two along axis 0", 0, {{2, 3}, {1, 3}}, {{2048, 256}, {2048, 256}}));
    rows.push_back(concatenation("three along the last axis", -1, {{2, 1}, {2, 3}, {2, 2}}, {}));
    rows.push_back(concatenation("one", 0, {{2, 3}}, {}));
    rows.push_back({"broadcast_to",
                    "column",
                    {{{3, 1}}},
                    [](const auto& x) {
                        return broadcast_to(x[0], {2, x[0].shape(0), 4});
                    },
                    [](const std::vector<Array>& x) {
                        return repeated(x[0], {2, 3, 4});
                    },
                    {{65536, 1}}});
    rows.push_back({"broadcast_to",
                    "scalar",
                    {{{}}},
                    [](const auto& x) {
                        return broadcast_to(x[0], {2, 3});
                    },
                    [](const std::vector<Array>& x) {
                        return repeated(x[0], {2, 3});
                    }});
    rows.push_back({"broadcast_to",
                    "middle axis",
                    {{{2, 1, 3}}},
                    [](const auto& x) {
                        return broadcast_to(x[0], {2, 4, 3});
                    },
                    [](const std::vector<Array>& x) {
                        return repeated(x[0], {2, 4, 3});
                    }});
    return rows;
}

}  // namespace stymo::test
