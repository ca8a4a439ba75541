#pragma once

#include <locale>
#include <memory>

namespace stymo::test {

/// Sets a global C++ locale that writes 12345 as "12.345" until the end of its scope.
class GroupingLocale {
public:
    GroupingLocale() : former_(std::locale::global(grouping())) {}
    GroupingLocale(const GroupingLocale&) = delete;
    GroupingLocale& operator=(const GroupingLocale&) = delete;
    ~GroupingLocale() { std::locale::global(former_); }

private:
    struct Grouping : std::numpunct<char> {
        char do_thousands_sep() const override { return '.'; }
        std::string do_grouping() const override { return "\3"; }
    };
    static std::locale grouping() {
        // The locale deletes its facet.
        return {std::locale(), std::make_unique<Grouping>().release()};
    }

    std::locale former_;
};

}  // namespace stymo::test
