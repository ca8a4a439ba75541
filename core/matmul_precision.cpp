#include "core/matmul_precision.h"

#include <atomic>

#include "core/error.h"

namespace stymo {

namespace {

std::atomic<MatmulPrecision>& setting() {
    static std::atomic<MatmulPrecision> precision{MatmulPrecision::highest};
    return precision;
}

std::atomic<bool>& emulation() {
    static std::atomic<bool> emulates{false};
    return emulates;
}

}  // namespace

void set_matmul_precision(MatmulPrecision precision) {
    setting().store(precision, std::memory_order_relaxed);
}

MatmulPrecision matmul_precision() {
    return setting().load(std::memory_order_relaxed);
}

const char* name_of(MatmulPrecision precision) {
    if (precision == MatmulPrecision::highest) return "highest";
    return precision == MatmulPrecision::high ? "high" : "medium";
}

MatmulPrecision matmul_precision_of(std::string_view name) {
    for (const auto precision :
         {MatmulPrecision::highest, MatmulPrecision::high, MatmulPrecision::medium})
        if (name == name_of(precision)) return precision;
    fail<ValueError>("unknown precision of matrix products: ", name);
}

PrecisionScope::PrecisionScope(MatmulPrecision precision, bool emulates)
    : before_(matmul_precision()), emulated_before_(emulates_medium()) {
    set_matmul_precision(precision);
    emulation().store(emulates, std::memory_order_relaxed);
}

PrecisionScope::~PrecisionScope() {
    set_matmul_precision(before_);
    emulation().store(emulated_before_, std::memory_order_relaxed);
}

bool emulates_medium() {
    return emulation().load(std::memory_order_relaxed);
}

}  // namespace stymo
