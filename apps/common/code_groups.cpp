#include "apps/common/code_groups.h"

#include <algorithm>
#include <sstream>

#include "apps/common/command_line.h"

namespace stymo {

CodeGroups parse_code_groups(const std::string& list) {
    CodeGroups taken{};
    std::istringstream stream(list);
    for (std::string name; std::getline(stream, name, ',');) {
        const auto* const found = std::ranges::find(code_names, name);
        if (found == code_names.end())
            fail<UsageError>("--take ", list, ": \"", name,
                             "\" is no group of codes; there are id, expr, tex and light");
        taken[static_cast<std::size_t>(found - code_names.begin())] = true;
    }
    return taken;
}

}  // namespace stymo
