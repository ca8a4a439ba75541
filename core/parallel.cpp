#include "core/parallel.h"

#include <omp.h>

#include <algorithm>
#include <exception>

#include "core/error.h"

namespace stymo {

void set_thread_count(int count) {
    if (count < 0) fail<ValueError>("[threads] ", count, " threads; give 0 for one per processor or a positive number");
    omp_set_num_threads(count == 0 ? omp_get_num_procs() : count);
}

int thread_count() {
    return omp_get_max_threads();
}

void parallel_for(std::int64_t count, std::int64_t grain, const std::function<void(std::int64_t, std::int64_t)>& body) {
    grain = std::max<std::int64_t>(grain, 1);
    const std::int64_t chunks = chunk_count(count, grain);
    if (chunks <= 1 || thread_count() == 1 || omp_in_parallel() != 0) {
        for (std::int64_t chunk = 0; chunk < chunks; ++chunk) body(chunk * grain, std::min(count, (chunk + 1) * grain));
        return;
    }
    std::exception_ptr error;
#pragma omp parallel for schedule(dynamic, 1)
    for (std::int64_t chunk = 0; chunk < chunks; ++chunk) {
        try {
            body(chunk * grain, std::min(count, (chunk + 1) * grain));
        } catch (...) {
#pragma omp critical(stymo_parallel_error)
            if (!error) error = std::current_exception();
        }
    }
    if (error) std::rethrow_exception(error);
}

}  // namespace stymo
