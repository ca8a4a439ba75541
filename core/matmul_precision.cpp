#include "core/matmul_precision.h"

#include <atomic>

namespace stymo {

namespace {

std::atomic<MatmulPrecision>& setting() {
    static std::atomic<MatmulPrecision> precision{MatmulPrecision::highest};
    return precision;
}

}  // namespace

void set_matmul_precision(MatmulPrecision precision) {
    setting().store(precision, std::memory_order_relaxed);
}

MatmulPrecision matmul_precision() {
    return setting().load(std::memory_order_relaxed);
}

const char* name_of(MatmulPrecision precision) {
    return precision == MatmulPrecision::high ? "high" : "highest";
}

}  // namespace stymo
