#include "core/dtype.h"

#include <ostream>

namespace stymo {

std::ostream& operator<<(std::ostream& stream, DType dtype) {
    return stream << (dtype == DType::float32 ? "float32" : "float64");
}

}  // namespace stymo
