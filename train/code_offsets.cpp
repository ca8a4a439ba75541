#include "train/code_offsets.h"

#include "core/error.h"
#include "core/ops/index.h"

namespace stymo {

CodeOffsets::CodeOffsets(const std::vector<std::string>& ids) {
    for (const std::string& id : ids) rows_.emplace(id, static_cast<std::int64_t>(rows_.size()));
    const auto count = static_cast<std::int64_t>(rows_.size());
    for (std::size_t group = 0; group < code_names.size(); ++group)
        parameters_.create(std::string("codes.offset.") + code_names[group],
                           Tensor::zeros({count, code_sizes[group]}));
}

Codes CodeOffsets::of(std::span<const std::string> ids) const {
    RowIndices rows;
    for (const std::string& id : ids) {
        const auto found = rows_.find(id);
        if (found == rows_.end())
            fail<ValueError>("face ", id, " has no learnt offset of its code");
        rows.push_back(found->second);
    }
    Codes codes;
    for (std::size_t group = 0; group < code_names.size(); ++group)
        codes.groups[group] = gather_rows(parameters_.all()[group].variable(), rows);
    return codes;
}

Codes face_codes(const Model& model, const FaceBatch& batch, const CodeOffsets* offsets) {
    const Codes codes = face_codes(model, batch);
    return offsets == nullptr ? codes : add(codes, offsets->of(batch.ids));
}

}  // namespace stymo
