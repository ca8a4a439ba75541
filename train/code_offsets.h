#pragma once

#include <map>
#include <span>
#include <string>
#include <vector>

#include "nn/models/face_batch.h"

namespace stymo {

/// Learnt offsets, which training adds to the morphable codes of its photos, as in HeadNeRF
/// (ModelConfig::code_source "morphable_offset"). They begin as zeros and are trained together with
/// the decoder's weights.
class CodeOffsets {
public:
    /// One row for each of `ids`, in the parameters codes.offset.{id,expr,tex,light}.
    explicit CodeOffsets(const std::vector<std::string>& ids);

    /// The offsets of these photos, one row for each. Throws ValueError for an id without offset.
    [[nodiscard]] Codes of(std::span<const std::string> ids) const;
    [[nodiscard]] ParameterStore& parameters() { return parameters_; }

private:
    std::map<std::string, std::int64_t> rows_;
    ParameterStore parameters_;
};

/// The codes of the batch's faces (nn/models/face_batch.h), plus the offsets that training has
/// learnt for them unless `offsets` is null.
[[nodiscard]] Codes face_codes(const Model& model, const FaceBatch& batch,
                               const CodeOffsets* offsets);

}  // namespace stymo
