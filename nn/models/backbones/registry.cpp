#include <array>

#include "core/error.h"
#include "nn/models/backbones/iresnet.h"
#include "nn/models/backbones/mobilefacenet.h"
#include "nn/models/backbones/small_conv.h"
#include "nn/models/encoder.h"

namespace stymo {
namespace {

struct Entry {
    const char* name;
    std::unique_ptr<Backbone> (*make)(ParameterStore& store, const std::string& prefix, Rng& rng);
};

/// Every backbone there is: a new one is a file beside this one and a row here, and a row in the test's table.
constexpr std::array<Entry, 4> registry{{
    {"iresnet100", make_iresnet100},
    {"iresnet50", make_iresnet50},
    {"mobilefacenet", make_mobilefacenet},
    {"small_conv", make_small_conv},
}};

}  // namespace

std::vector<std::string> backbone_names() {
    std::vector<std::string> names;
    for (const Entry& entry : registry) names.emplace_back(entry.name);
    return names;
}

std::unique_ptr<Backbone> make_backbone(const std::string& name, ParameterStore& store, const std::string& prefix, Rng& rng) {
    for (const Entry& entry : registry)
        if (name == entry.name) return entry.make(store, prefix, rng);
    std::string known;
    for (const Entry& entry : registry) known += (known.empty() ? "" : ", ") + std::string(entry.name);
    fail<ConfigError>("encoder.backbone: no backbone is called \"", name, "\"; choose one of ", known);
}

}  // namespace stymo
