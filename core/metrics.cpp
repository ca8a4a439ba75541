#include "core/metrics.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>
#include <span>
#include <vector>

#include "core/error.h"
#include "core/parallel.h"

namespace stymo {
namespace {

constexpr int window_size = 11;

void require_match(const char* function, const Tensor& a, const Tensor& b) {
    if (a.rank() != 3 || !(a.shape() == b.shape()) || a.size() == 0)
        fail<ShapeError>("[", function,
                         "] expected two images (height, width, channels) of one shape, got ",
                         a.shape(), " and ", b.shape());
    if (a.dtype() != b.dtype())
        fail<TypeError>("[", function, "] the images have different types, ", a.dtype(), " and ",
                        b.dtype());
}

/// Mean of `distance(a_i - b_i)` over all elements.
template <class Distance>
double mean_distance(const Tensor& a, const Tensor& b, Distance distance) {
    return dispatch(a.dtype(), [&]<class T>(T) {
        const auto a_values = a.values<T>();
        const auto b_values = b.values<T>();
        double total = 0.0;
        for (std::size_t i = 0; i < a_values.size(); ++i)
            total += distance(static_cast<double>(a_values[i]) - static_cast<double>(b_values[i]));
        return total / static_cast<double>(a_values.size());
    });
}

std::array<double, window_size> gaussian_window() {
    constexpr double deviation = 1.5;
    std::array<double, window_size> window{};
    for (int i = 0; i < window_size; ++i) {
        const int distance = i - window_size / 2;
        const double offset = distance / deviation;
        window[static_cast<std::size_t>(i)] = std::exp(-0.5 * offset * offset);
    }
    const double total = std::accumulate(window.begin(), window.end(), 0.0);
    for (double& weight : window) weight /= total;
    return window;
}

/// Weighted means of a, b, a^2, b^2 and ab over one window.
struct Moments {
    double a = 0.0;
    double b = 0.0;
    double aa = 0.0;
    double bb = 0.0;
    double ab = 0.0;

    void add(double weight, const Moments& other) {
        a += weight * other.a;
        b += weight * other.b;
        aa += weight * other.aa;
        bb += weight * other.bb;
        ab += weight * other.ab;
    }
};

double similarity(const Moments& mean) {
    constexpr double luminance_constant = 0.01 * 0.01;
    constexpr double contrast_constant = 0.03 * 0.03;
    const double variance_a = mean.aa - mean.a * mean.a;
    const double variance_b = mean.bb - mean.b * mean.b;
    const double covariance = mean.ab - mean.a * mean.b;
    const double numerator =
        (2.0 * mean.a * mean.b + luminance_constant) * (2.0 * covariance + contrast_constant);
    const double denominator = (mean.a * mean.a + mean.b * mean.b + luminance_constant) *
                               (variance_a + variance_b + contrast_constant);
    return numerator / denominator;
}

/// Which windows, by their upper left pixels, hold no 0 of (height, width, 1). Empty: all.
std::vector<bool> counted_windows(const Tensor& counted) {
    std::vector<bool> windows;
    if (!counted.defined()) return windows;
    const std::int64_t height = counted.shape(0), width = counted.shape(1);
    const std::vector<double> values = counted.to_vector();
    // The number of zeros in each column's last rows, as a window moves down.
    std::vector<int> zeros(static_cast<std::size_t>(width));
    const auto change = [&](std::int64_t row, int by) {
        for (std::size_t i = 0; i < zeros.size(); ++i)
            if (values[static_cast<std::size_t>(row * width) + i] == 0.0) zeros[i] += by;
    };
    for (std::int64_t row = 0; row < height; ++row) {
        change(row, 1);
        if (row >= window_size) change(row - window_size, -1);
        if (row < window_size - 1) continue;
        for (auto first = zeros.begin(); zeros.end() - first >= window_size; ++first)
            windows.push_back(
                std::all_of(first, first + window_size, [](int n) { return n == 0; }));
    }
    return windows;
}

/// Sum of the similarity over the windows whose top row is `row`, of those that count.
template <class T>
double row_similarity(std::span<const T> a, std::span<const T> b, std::size_t row,
                      std::size_t row_length, std::size_t channels,
                      const std::array<double, window_size>& window,
                      const std::vector<bool>& counted) {
    std::vector<Moments> column_means(row_length);
    for (std::size_t k = 0; k < window.size(); ++k) {
        const auto a_row = a.subspan((row + k) * row_length, row_length);
        const auto b_row = b.subspan((row + k) * row_length, row_length);
        for (std::size_t i = 0; i < row_length; ++i) {
            const auto a_value = static_cast<double>(a_row[i]),
                       b_value = static_cast<double>(b_row[i]);
            column_means[i].add(window[k], {a_value, b_value, a_value * a_value, b_value * b_value,
                                            a_value * b_value});
        }
    }
    double total = 0.0;
    const std::size_t columns = row_length / channels - window.size() + 1;
    for (std::size_t i = 0; i + (window.size() - 1) * channels < row_length; ++i) {
        if (!counted.empty() && !counted[row * columns + i / channels]) continue;
        Moments mean;
        for (std::size_t k = 0; k < window.size(); ++k) {
            mean.add(window[k], column_means[i + k * channels]);
        }
        total += similarity(mean);
    }
    return total;
}

}  // namespace

double mean_absolute_error(const Tensor& a, const Tensor& b) {
    require_match("mean_absolute_error", a, b);
    return mean_distance(a, b, [](double difference) { return std::abs(difference); });
}

double l1_error(const Tensor& a, const Tensor& b) {
    require_match("l1_error", a, b);
    return static_cast<double>(a.shape(2)) * mean_absolute_error(a, b);
}

double peak_signal_to_noise_ratio(const Tensor& a, const Tensor& b) {
    require_match("peak_signal_to_noise_ratio", a, b);
    const double squared_error =
        mean_distance(a, b, [](double difference) { return difference * difference; });
    return squared_error == 0.0 ? std::numeric_limits<double>::infinity()
                                : -10.0 * std::log10(squared_error);
}

double structural_similarity(const Tensor& a, const Tensor& b, const Tensor& counted) {
    require_match("structural_similarity", a, b);
    const std::int64_t rows = a.shape(0) - window_size + 1, columns = a.shape(1) - window_size + 1,
                       channels = a.shape(2);
    if (rows < 1 || columns < 1)
        fail<ShapeError>("[structural_similarity] needs at least ", window_size, " x ", window_size,
                         " pixels, got ", a.shape());
    if (counted.defined() && !(counted.shape() == a.shape().with(2, 1)))
        fail<ShapeError>("[structural_similarity] counted pixels ", counted.shape(),
                         " of an image ", a.shape());
    const std::vector<bool> windows = counted_windows(counted);
    const auto count = windows.empty() ? rows * columns : std::ranges::count(windows, true);
    if (count == 0) return 1.0;
    const auto window = gaussian_window();
    std::vector<double> row_totals(static_cast<std::size_t>(rows));
    dispatch(a.dtype(), [&]<class T>(T) {
        const auto a_values = a.values<T>();
        const auto b_values = b.values<T>();
        const auto row_length = static_cast<std::size_t>(a.shape(1) * channels);
        parallel_for(rows, 8, [&](std::int64_t begin, std::int64_t end) {
            for (auto row = static_cast<std::size_t>(begin); row < static_cast<std::size_t>(end);
                 ++row)
                row_totals[row] =
                    row_similarity<T>(a_values, b_values, row, row_length,
                                      static_cast<std::size_t>(channels), window, windows);
        });
    });
    return std::accumulate(row_totals.begin(), row_totals.end(), 0.0) /
           static_cast<double>(count * channels);
}

}  // namespace stymo
