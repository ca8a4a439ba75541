#include "support/check_close.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <sstream>

namespace stymo::test {

CloseReport check_close(const Tensor& actual, const Tensor& expected, double tolerance) {
    CloseReport report;
    std::ostringstream message;
    message.precision(17);
    if (!actual.defined() || !expected.defined() || !(actual.shape() == expected.shape())) {
        message << "shape " << actual.shape() << ", expected " << expected.shape();
        report.message = message.str();
        return report;
    }
    const std::vector<double> a = actual.to_vector();
    const std::vector<double> e = expected.to_vector();
    double magnitude = 1e-3;
    for (const double value : e) magnitude = std::max(magnitude, std::abs(value));
    std::size_t worst = 0;
    report.passed = true;
    for (std::size_t i = 0; i < a.size(); ++i) {
        const double error = std::abs(a[i] - e[i]) / magnitude;
        if (!(error <= tolerance)) report.passed = false;
        if (!(error <= report.error)) {
            report.error = error;
            worst = i;
        }
        if (std::isnan(error)) break;
    }
    if (!a.empty()) {
        message << "worst at element " << worst << " of " << actual.shape() << ": " << a[worst]
                << ", expected " << e[worst] << ", relative error " << report.error << ", allowed "
                << tolerance;
    }
    report.message = message.str();
    return report;
}

bool identical(const Tensor& a, const Tensor& b) {
    if (a.dtype() != b.dtype() || !(a.shape() == b.shape())) return false;
    return dispatch(a.dtype(), [&]<class T>(T) {
        return a.size() == 0 || std::memcmp(a.values<T>().data(), b.values<T>().data(),
                                            a.values<T>().size_bytes()) == 0;
    });
}

bool all_identical(const std::vector<Tensor>& a, const std::vector<Tensor>& b) {
    return std::ranges::equal(a, b, identical);
}

}  // namespace stymo::test
