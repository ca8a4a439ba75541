#include <array>

#include "core/error.h"
#include "nn/pretrained/backbones/backbone.h"
#include "nn/pretrained/backbones/iresnet.h"
#include "nn/pretrained/backbones/landmark_backbone.h"
#include "nn/pretrained/backbones/mobilefacenet.h"
#include "nn/pretrained/backbones/small_conv.h"

namespace stymo {
namespace {

struct Entry {
    const char* name;
    std::unique_ptr<Backbone> (*make)(ParameterStore& store, const std::string& prefix, Rng& rng);
    const char* published;  ///< how to get its trained weights; empty: there are none
};

constexpr const char* insightface =
    "import backbone.pth of github.com/deepinsight/insightface with `stymo-weights import`";

/// The list of all backbones. To add one: a file in this folder, a row here, and a row in the
/// test's table.
constexpr std::array<Entry, 5> registry{{
    {"iresnet100", make_iresnet100, insightface},
    {"iresnet50", make_iresnet50, insightface},
    {"landmarks", make_landmark_backbone,
     "stymo has them, configs/models/landmarks/landmarks.safetensors"},
    {"mobilefacenet", make_mobilefacenet,
     "import weights/mobilefacenet.pt of github.com/foamliu/MobileFaceNet with "
     "`stymo-weights import`"},
    {"small_conv", make_small_conv, ""},
}};

}  // namespace

std::vector<std::string> backbone_names() {
    std::vector<std::string> names;
    for (const Entry& entry : registry) names.emplace_back(entry.name);
    return names;
}

namespace {

const Entry& entry_of(const std::string& name) {
    for (const Entry& entry : registry)
        if (name == entry.name) return entry;
    std::string known;
    for (const Entry& entry : registry)
        known += (known.empty() ? "" : ", ") + std::string(entry.name);
    fail<ConfigError>("encoder.backbone: no backbone is called \"", name, "\"; choose one of ",
                      known);
}

}  // namespace

std::unique_ptr<Backbone> make_backbone(const std::string& name, ParameterStore& store,
                                        const std::string& prefix, Rng& rng) {
    return entry_of(name).make(store, prefix, rng);
}

const char* published_weights(const std::string& backbone) {
    return entry_of(backbone).published;
}

}  // namespace stymo
