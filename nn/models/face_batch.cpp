#include "nn/models/face_batch.h"

#include <algorithm>

#include "core/error.h"

namespace stymo {

bool FaceBatch::has_codes() const {
    if (!code_present.defined()) return false;
    const std::vector<double> present = code_present.to_vector();
    return std::ranges::any_of(present, [](double value) { return value > 0.0; });
}

Codes face_codes(const Model& model, const FaceBatch& batch) {
    if (uses_encoder(model.config())) return model.encoder()(Variable(batch.input));
    const std::vector<double> present = batch.code_present.defined()
                                            ? batch.code_present.to_vector()
                                            : std::vector<double>(batch.cameras.size());
    for (std::size_t i = 0; i < present.size(); ++i) {
        if (present[i] != 0.0) continue;
        fail<ValueError>(
            "face ", i < batch.ids.size() ? batch.ids[i] : std::to_string(i),
            " has no code of a morphable model, which this model starts from (codes.source = ",
            model.config().code_source,
            "); prepare it with stymo-prep --morphable, or train with an encoder");
    }
    Codes codes;
    std::ranges::copy(batch.codes, codes.groups.begin());
    return codes;
}

}  // namespace stymo
