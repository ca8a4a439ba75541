#include <cmath>

#include "core/op_cases.h"
#include "core/ops/ops.h"

namespace stymo::test {
namespace {

/// Weight of input element `input` in output element `output` along one axis.
using AxisWeight = std::function<double(std::int64_t output, std::int64_t input)>;

Array separable(const Array& x, std::int64_t height, std::int64_t width, const AxisWeight& vertical,
                const AxisWeight& horizontal) {
    return generate({x.extents[0], height, width, x.extents[3]}, [&](const Index& i) {
        double total = 0.0;
        for (std::int64_t row = 0; row < x.extents[1]; ++row) {
            for (std::int64_t column = 0; column < x.extents[2]; ++column) {
                total += vertical(i[1], row) * horizontal(i[2], column) *
                         x.at({i[0], row, column, i[3]});
            }
        }
        return total;
    });
}

const Shape speed_image{4, 96, 96, 16};

/// An arbitrary sparse matrix with one row more than columns, some of its entries given twice.
ResampleMatrix arbitrary_matrix(int length) {
    std::vector<ResampleMatrix::Entry> entries;
    for (int output = 0; output <= length; ++output) {
        if (output == 1) continue;
        entries.push_back({output, (3 * output + 1) % length, 0.5 + 0.25 * (output % 3)});
        entries.push_back({output, output % length, -0.75});
    }
    return {length + 1, length, entries};
}

double arbitrary_weight(std::int64_t length, std::int64_t output, std::int64_t input) {
    if (output == 1) return 0.0;
    const double first =
        input == (3 * output + 1) % length ? 0.5 + 0.25 * static_cast<double>(output % 3) : 0.0;
    return first - (input == output % length ? 0.75 : 0.0);
}

struct FilterForm {
    const char* name;
    std::vector<double> filter;
    int up;
    int down;
    int pad_before;
    int pad_after;
};

/// The definition, step by step: insert zeros, pad, convolve, decimate.
std::vector<double> upfirdn(const std::vector<double>& x, const FilterForm& form) {
    const auto before = static_cast<std::size_t>(form.pad_before);
    std::vector<double> padded(before + x.size() * static_cast<std::size_t>(form.up) +
                                   static_cast<std::size_t>(form.pad_after),
                               0.0);
    for (std::size_t i = 0; i < x.size(); ++i)
        padded[before + i * static_cast<std::size_t>(form.up)] = x[i];
    const std::size_t taps = form.filter.size();
    std::vector<double> result;
    for (std::size_t i = 0; i + taps <= padded.size(); i += static_cast<std::size_t>(form.down)) {
        double total = 0.0;
        for (std::size_t tap = 0; tap < taps; ++tap)
            total += form.filter[taps - 1 - tap] * padded[i + tap];
        result.push_back(total);
    }
    return result;
}

/// The filter's answer to an impulse at `input`.
std::vector<double> impulse_response(std::int64_t length, std::int64_t input,
                                     const FilterForm& form) {
    std::vector<double> impulse(static_cast<std::size_t>(length), 0.0);
    impulse[static_cast<std::size_t>(input)] = 1.0;
    return upfirdn(impulse, form);
}

OpCase filter_case(const FilterForm& form, const Shape& shape) {
    return {"upfirdn2d",
            form.name,
            {{shape}},
            [form](const auto& x) {
                return upfirdn2d(x[0], form.filter, form.up, form.down, form.pad_before,
                                 form.pad_after);
            },
            [form](const std::vector<Array>& x) {
                const auto weight = [&form](std::int64_t length) {
                    return [&form, length](std::int64_t output, std::int64_t input) {
                        return impulse_response(length, input,
                                                form)[static_cast<std::size_t>(output)];
                    };
                };
                const std::int64_t height = x[0].extents[1];
                const std::int64_t width = x[0].extents[2];
                const auto size = [&form](std::int64_t length) {
                    return static_cast<std::int64_t>(impulse_response(length, 0, form).size());
                };
                return separable(x[0], size(height), size(width), weight(height), weight(width));
            },
            {speed_image}};
}

double mirrored_blur(std::int64_t length, std::int64_t output, std::int64_t input) {
    double weight = output == input ? 0.5 : 0.0;
    for (const std::int64_t step : {-1, 1}) {
        std::int64_t neighbour = output + step;
        if (neighbour < 0) neighbour = -neighbour;
        if (neighbour >= length) neighbour = 2 * (length - 1) - neighbour;
        if (neighbour == input) weight += 0.25;
    }
    return weight;
}

/// A triangle around the half-pixel centre, cut off at the edges, where the outermost element takes
/// the rest.
double triangle(double scale, std::int64_t length, std::int64_t output, std::int64_t input) {
    const auto last = static_cast<double>(length - 1);
    const double position =
        std::min(std::max((static_cast<double>(output) + 0.5) * scale - 0.5, 0.0), last);
    return std::max(0.0, 1.0 - std::abs(position - static_cast<double>(input)));
}

double keys_cubic(double x) {
    x = std::abs(x);
    if (x < 1.0) return 1.5 * x * x * x - 2.5 * x * x + 1.0;
    if (x < 2.0) return -0.5 * x * x * x + 2.5 * x * x - 4.0 * x + 2.0;
    return 0.0;
}

double antialiased_cubic(double scale, std::int64_t length, std::int64_t output,
                         std::int64_t input) {
    const double centre = (static_cast<double>(output) + 0.5) * scale;
    const double stretch = std::max(scale, 1.0);
    const auto weight = [&](std::int64_t i) {
        return keys_cubic((static_cast<double>(i) + 0.5 - centre) / stretch);
    };
    double total = 0.0;
    for (std::int64_t i = 0; i < length; ++i) total += weight(i);
    return weight(input) / total;
}

double block_mean(double scale, std::int64_t, std::int64_t output, std::int64_t input) {
    return std::floor((static_cast<double>(input) + 0.5) / scale) == static_cast<double>(output)
               ? 1.0 / scale
               : 0.0;
}

using ResizeFunction = Variable (*)(const Variable&, int, int);
using ResizeWeight = double (*)(double scale, std::int64_t length, std::int64_t output,
                                std::int64_t input);

/// Sizes are numerators over denominators of the input's, so that they also serve the benchmark.
OpCase resize_case(const char* name, const char* form, const Shape& shape, int numerator,
                   int denominator, ResizeFunction resize, ResizeWeight weight) {
    return {name,
            form,
            {{shape}},
            [=](const auto& x) {
                return resize(x[0], static_cast<int>(x[0].shape(1) * numerator / denominator),
                              static_cast<int>(x[0].shape(2) * numerator / denominator));
            },
            [=](const std::vector<Array>& x) {
                const auto axis = [=](std::int64_t length, std::int64_t size) {
                    const double scale = static_cast<double>(length) / static_cast<double>(size);
                    return [=](std::int64_t output, std::int64_t input) {
                        return weight(scale, length, output, input);
                    };
                };
                const std::int64_t height = x[0].extents[1] * numerator / denominator;
                const std::int64_t width = x[0].extents[2] * numerator / denominator;
                return separable(x[0], height, width, axis(x[0].extents[1], height),
                                 axis(x[0].extents[2], width));
            },
            {speed_image}};
}

Array blurred(const Array& x) {
    const auto axis = [](std::int64_t length) {
        return [length](std::int64_t o, std::int64_t i) { return mirrored_blur(length, o, i); };
    };
    return separable(x, x.extents[1], x.extents[2], axis(x.extents[1]), axis(x.extents[2]));
}

OpCase upsampling_case(const char* name, Variable (*function)(const Variable&, const Variable&),
                       const char* form, const Shape& image) {
    return {name,
            form,
            {{image}, {image.with(3, 4 * image[3])}},
            [function](const auto& x) { return function(x[0], x[1]); },
            [](const std::vector<Array>& x) {
                const auto& e = x[0].extents;
                return blurred(generate({e[0], 2 * e[1], 2 * e[2], e[3]}, [&](const Index& i) {
                    const std::int64_t subpixel = 2 * (i[1] % 2) + i[2] % 2;
                    return x[0].at({i[0], i[1] / 2, i[2] / 2, i[3]}) +
                           x[1].at({i[0], i[1] / 2, i[2] / 2, subpixel * e[3] + i[3]});
                }));
            },
            {{1, 64, 64, 64}, {1, 64, 64, 256}}};
}

void add_pixel_cases(std::vector<OpCase>& rows) {
    const auto inside = [](const Index& i) {
        return Index{i[0], i[1] / 2, i[2] / 2, 4 * i[3] + 2 * (i[1] % 2) + i[2] % 2};
    };
    rows.push_back({"pixel_shuffle",
                    "image",
                    {{{2, 2, 1, 8}}},
                    [](const auto& x) { return pixel_shuffle(x[0]); },
                    [inside](const std::vector<Array>& x) {
                        const auto& e = x[0].extents;
                        return generate({e[0], 2 * e[1], 2 * e[2], e[3] / 4},
                                        [&](const Index& i) { return x[0].at(inside(i)); });
                    },
                    {speed_image}});
    rows.push_back({"pixel_shuffle_onto",
                    "image",
                    {{{2, 2, 1, 2}}, {{2, 2, 1, 8}}},
                    [](const auto& x) { return pixel_shuffle_onto(x[0], x[1]); },
                    [inside](const std::vector<Array>& x) {
                        const auto& e = x[0].extents;
                        return generate({e[0], 2 * e[1], 2 * e[2], e[3]}, [&](const Index& i) {
                            return x[0].at({i[0], i[1] / 2, i[2] / 2, i[3]}) + x[1].at(inside(i));
                        });
                    },
                    {{1, 64, 64, 8}, {1, 64, 64, 32}}});
    rows.push_back({"pixel_unshuffle",
                    "image",
                    {{{2, 2, 4, 2}}},
                    [](const auto& x) { return pixel_unshuffle(x[0]); },
                    [inside](const std::vector<Array>& x) {
                        const auto& e = x[0].extents;
                        Array y = generate({e[0], e[1] / 2, e[2] / 2, 4 * e[3]},
                                           [](const Index&) { return 0.0; });
                        for_each_index(e, [&](const Index& i) { y.at(inside(i)) = x[0].at(i); });
                        return y;
                    },
                    {speed_image}});
}

}  // namespace

std::vector<OpCase> resample_cases() {
    std::vector<OpCase> rows;
    rows.push_back({"resample",
                    "arbitrary matrices",
                    {{{2, 3, 4, 2}}},
                    [](const auto& x) {
                        return resample(x[0], arbitrary_matrix(static_cast<int>(x[0].shape(1))),
                                        arbitrary_matrix(static_cast<int>(x[0].shape(2))));
                    },
                    [](const std::vector<Array>& x) {
                        const auto axis = [](std::int64_t length) {
                            return [length](std::int64_t o, std::int64_t i) {
                                return arbitrary_weight(length, o, i);
                            };
                        };
                        const std::int64_t height = x[0].extents[1];
                        const std::int64_t width = x[0].extents[2];
                        return separable(x[0], height + 1, width + 1, axis(height), axis(width));
                    },
                    {speed_image}});
    const std::vector<double> binomial{0.125, 0.375, 0.375, 0.125};
    rows.push_back(filter_case({"up 2", {0.25, 0.75, 0.75, 0.25}, 2, 1, 2, 1}, {1, 3, 2, 2}));
    rows.push_back(filter_case({"down 2", binomial, 1, 2, 1, 1}, {1, 4, 5, 2}));
    rows.push_back(filter_case({"asymmetric filter", {0.1, 0.2, 0.7}, 1, 1, 2, 0}, {1, 3, 4, 1}));
    rows.push_back(filter_case({"up 2, down 3", {0.3, 0.5, 0.1, 0.1}, 2, 3, 3, 2}, {1, 4, 3, 2}));
    rows.push_back({"blur",
                    "image",
                    {{{1, 4, 3, 2}}},
                    [](const auto& x) { return blur(x[0]); },
                    [](const std::vector<Array>& x) { return blurred(x[0]); },
                    {speed_image}});
    rows.push_back(resize_case("resize_bilinear", "twice the size", {1, 3, 2, 2}, 2, 1,
                               resize_bilinear, triangle));
    rows.push_back(resize_case("resize_bilinear", "two thirds", {1, 6, 3, 1}, 2, 3, resize_bilinear,
                               triangle));
    rows.push_back(resize_case("resize_bilinear", "five thirds", {1, 3, 3, 1}, 5, 3,
                               resize_bilinear, triangle));
    rows.push_back(resize_case("resize_bicubic", "half", {1, 8, 6, 1}, 1, 2, resize_bicubic,
                               antialiased_cubic));
    rows.push_back(resize_case("resize_bicubic", "two thirds", {1, 6, 3, 2}, 2, 3, resize_bicubic,
                               antialiased_cubic));
    rows.push_back(resize_case("resize_bicubic", "five thirds", {1, 3, 3, 1}, 5, 3, resize_bicubic,
                               antialiased_cubic));
    rows.push_back(resize_case("resize_box", "half", {1, 4, 2, 2}, 1, 2, resize_box, block_mean));
    rows.push_back(resize_case("resize_box", "third", {1, 6, 3, 1}, 1, 3, resize_box, block_mean));
    rows.push_back(upsampling_case("blur_upsampled", blur_upsampled, "images", {2, 2, 3, 2}));
    rows.push_back(
        upsampling_case("blur_upsampled", blur_upsampled, "vectors and a rest", {1, 3, 1, 19}));
    rows.push_back(upsampling_case("blur_upsampled_reference", blur_upsampled_reference, "images",
                                   {2, 2, 3, 2}));
    add_pixel_cases(rows);
    return rows;
}

}  // namespace stymo::test
