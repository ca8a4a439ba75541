#include "apps/view/random_token.h"

#include <random>

namespace stymo::view {

std::string random_token() {
    constexpr const char* digits = "0123456789abcdef";
    constexpr int length = 32;
    std::random_device source;
    std::uniform_int_distribution<int> digit(0, 15);
    std::string token;
    for (int i = 0; i < length; ++i) token += digits[digit(source)];
    return token;
}

}  // namespace stymo::view
