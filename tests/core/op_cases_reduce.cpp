#include <algorithm>

#include "core/op_cases.h"
#include "core/ops/ops.h"

namespace stymo::test {
namespace {

/// Adds every element of x at the index of `extents` (aligned at the last axis) that broadcasting
/// would take it from.
Array summed_to(const Array& x, const std::vector<std::int64_t>& extents) {
    Array total = generate(extents, [](const Index&) { return 0.0; });
    for_each_index(x.extents, [&](const Index& i) {
        Index target(i.end() - static_cast<std::ptrdiff_t>(extents.size()), i.end());
        for (std::size_t axis = 0; axis < extents.size(); ++axis)
            target[axis] = std::min(target[axis], extents[axis] - 1);
        total.at(target) += x.at(i);
    });
    return total;
}

Array divided_by_count(Array total, const Array& x) {
    const double count =
        static_cast<double>(x.values.size()) / static_cast<double>(total.values.size());
    for (double& value : total.values) value /= count;
    return total;
}

void add_totals(std::vector<OpCase>& rows) {
    const CaseInput input{{2, 3, 4}};
    const Shape speed{64, 64, 256};
    rows.push_back({"sum",
                    "all",
                    {input},
                    [](const auto& x) { return sum(x[0]); },
                    [](const std::vector<Array>& x) { return summed_to(x[0], {}); },
                    {speed}});
    rows.push_back(
        {"mean",
         "all",
         {input},
         [](const auto& x) { return mean(x[0]); },
         [](const std::vector<Array>& x) { return divided_by_count(summed_to(x[0], {}), x[0]); },
         {speed}});
    struct Form {
        const char* name;
        std::vector<int> axes;
        std::vector<std::int64_t> kept;
    };
    const std::vector<Form> forms{{"axis 0", {0}, {1, 3, 4}},
                                  {"axis 1", {1}, {2, 1, 4}},
                                  {"last axis", {-1}, {2, 3, 1}},
                                  {"axes 0 and 2", {0, 2}, {1, 3, 1}},
                                  {"axes 1 and 2", {2, 1}, {2, 1, 1}}};
    for (const Form& form : forms) {
        rows.push_back({"sum",
                        form.name,
                        {input},
                        [form](const auto& x) { return sum(x[0], form.axes); },
                        [form](const std::vector<Array>& x) { return summed_to(x[0], form.kept); },
                        {speed}});
        rows.push_back({"mean",
                        form.name,
                        {input},
                        [form](const auto& x) { return mean(x[0], form.axes); },
                        [form](const std::vector<Array>& x) {
                            return divided_by_count(summed_to(x[0], form.kept), x[0]);
                        }});
    }
}

void add_running_sums(std::vector<OpCase>& rows) {
    for (const int axis : {0, 1, -1}) {
        for (const bool exclusive : {false, true}) {
            const std::size_t along = axis < 0 ? 2 : static_cast<std::size_t>(axis);
            rows.push_back(
                {"cumsum",
                 (exclusive ? "exclusive axis " : "inclusive axis ") + std::to_string(axis),
                 {{{2, 3, 4}}},
                 [=](const auto& x) { return cumsum(x[0], axis, exclusive); },
                 [=](const std::vector<Array>& x) {
                     return generate(x[0].extents, [&](const Index& i) {
                         double total = 0.0;
                         Index j = i;
                         const std::int64_t end = i[along] + (exclusive ? 0 : 1);
                         for (j[along] = 0; j[along] < end; ++j[along]) total += x[0].at(j);
                         return total;
                     });
                 },
                 {{64, 64, 256}}});
        }
    }
}

Array gathered(const Array& x, const RowIndices& rows) {
    auto extents = x.extents;
    extents[0] = static_cast<std::int64_t>(rows.size());
    return generate(extents, [&](Index i) {
        i[0] = rows[static_cast<std::size_t>(i[0])];
        return x.at(i);
    });
}

Array scattered(const Array& x, const RowIndices& rows, std::int64_t row_count) {
    auto extents = x.extents;
    extents[0] = row_count;
    Array total = generate(extents, [](const Index&) { return 0.0; });
    for_each_index(x.extents, [&](const Index& i) {
        Index target = i;
        target[0] = rows[static_cast<std::size_t>(i[0])];
        total.at(target) += x.at(i);
    });
    return total;
}

/// Repeats rows and leaves some out.
RowIndices some_rows(std::int64_t count, std::int64_t row_count) {
    RowIndices rows;
    for (std::int64_t i = 0; i < count; ++i) rows.push_back((i * i + 3) % row_count);
    return rows;
}

}  // namespace

std::vector<OpCase> reduce_cases() {
    std::vector<OpCase> rows;
    add_totals(rows);
    rows.push_back({"sum_to",
                    "channels",
                    {{{2, 3, 4}}},
                    [](const auto& x) { return sum_to(x[0], {x[0].shape(2)}); },
                    [](const std::vector<Array>& x) { return summed_to(x[0], {4}); },
                    {{64, 64, 256}}});
    rows.push_back({"sum_to",
                    "column",
                    {{{2, 3, 4}}},
                    [](const auto& x) {
                        return sum_to(x[0], {3, 1});
                    },
                    [](const std::vector<Array>& x) {
                        return summed_to(x[0], {3, 1});
                    }});
    rows.push_back({"sum_to",
                    "scalar",
                    {{{2, 3}}},
                    [](const auto& x) { return sum_to(x[0], {}); },
                    [](const std::vector<Array>& x) { return summed_to(x[0], {}); }});
    add_running_sums(rows);
    return rows;
}

std::vector<OpCase> index_cases() {
    std::vector<OpCase> rows;
    const OpFunction gather = [](const auto& x) {
        return gather_rows(x[0], some_rows(x[0].shape(0) + 2, x[0].shape(0)));
    };
    const OpReference gather_reference = [](const std::vector<Array>& x) {
        return gathered(x[0], some_rows(x[0].extents[0] + 2, x[0].extents[0]));
    };
    const OpFunction scatter = [](const auto& x) {
        return scatter_add_rows(x[0], some_rows(x[0].shape(0), x[0].shape(0) - 1),
                                x[0].shape(0) - 1);
    };
    const OpReference scatter_reference = [](const std::vector<Array>& x) {
        return scattered(x[0], some_rows(x[0].extents[0], x[0].extents[0] - 1),
                         x[0].extents[0] - 1);
    };
    rows.push_back({"gather_rows", "matrix", {{{4, 3}}}, gather, gather_reference, {{16384, 64}}});
    rows.push_back({"gather_rows", "rank 3", {{{4, 2, 2}}}, gather, gather_reference});
    rows.push_back(
        {"scatter_add_rows", "matrix", {{{6, 3}}}, scatter, scatter_reference, {{16384, 64}}});
    rows.push_back({"scatter_add_rows", "rank 3", {{{6, 2, 2}}}, scatter, scatter_reference});
    return rows;
}

}  // namespace stymo::test
