#include "train/face_codes.h"

#include "core/error.h"
#include "core/ops/index.h"

namespace stymo {

CodeOffsets::CodeOffsets(const std::vector<std::string>& ids) {
    for (const std::string& id : ids) rows_.emplace(id, static_cast<std::int64_t>(rows_.size()));
    const auto count = static_cast<std::int64_t>(rows_.size());
    for (std::size_t group = 0; group < code_names.size(); ++group)
        parameters_.create(std::string("codes.offset.") + code_names[group], Tensor::zeros({count, code_sizes[group]}));
}

Codes CodeOffsets::of(std::span<const std::string> ids) const {
    RowIndices rows;
    for (const std::string& id : ids) {
        const auto found = rows_.find(id);
        if (found == rows_.end()) fail<ValueError>("face ", id, " has no learnt offset of its code");
        rows.push_back(found->second);
    }
    Codes codes;
    for (std::size_t group = 0; group < code_names.size(); ++group)
        codes.groups[group] = gather_rows(parameters_.all()[group].variable(), rows);
    return codes;
}

Codes face_codes(const Model& model, const TrainingBatch& batch, const CodeOffsets* offsets) {
    if (model.config().code_source == "encoder") return model.encoder()(Variable(batch.input));
    const std::vector<double> present = batch.code_present.to_vector();
    for (std::size_t i = 0; i < present.size(); ++i) {
        if (present[i] == 0.0)
            fail<ValueError>("face ", batch.ids[i],
                             " has no code of a morphable model, which this model starts from (codes.source = ",
                             model.config().code_source, "); prepare it with stymo-prep --morphable, or train with an encoder");
    }
    Codes codes;
    for (std::size_t group = 0; group < code_names.size(); ++group) codes.groups[group] = batch.codes[group];
    return offsets == nullptr ? codes : add(codes, offsets->of(batch.ids));
}

}  // namespace stymo
