#pragma once

#include <map>
#include <span>
#include <string>
#include <vector>

#include "nn/models/model.h"
#include "train/batch.h"

namespace stymo {

/// What training adds to the morphable model's code of each of its photos (ModelConfig::code_source "morphable_offset";
/// HeadNeRF): zeros at first, learnt with the decoder's weights.
class CodeOffsets {
public:
    /// One row for each of `ids`, in the parameters codes.offset.{id,expr,tex,light}.
    explicit CodeOffsets(const std::vector<std::string>& ids);

    /// Those of these photos. Throws ValueError for an id that has none.
    [[nodiscard]] Codes of(std::span<const std::string> ids) const;
    [[nodiscard]] ParameterStore& parameters() { return parameters_; }

private:
    std::map<std::string, std::int64_t> rows_;
    ParameterStore parameters_;
};

/// Codes of the batch's faces in Z, before any fitting: the encoder's, or the data's where the model has none; with `offsets`
/// plus these. Throws ValueError naming the first face whose code is needed and missing.
[[nodiscard]] Codes face_codes(const Model& model, const TrainingBatch& batch, const CodeOffsets* offsets = nullptr);

}  // namespace stymo
