#include "core/resample_matrix.h"

#include <algorithm>
#include <utility>

#include "core/error.h"

namespace stymo {

ResampleMatrix::ResampleMatrix(int output_length, int input_length, std::vector<Entry> entries)
    : output_length_(output_length), input_length_(input_length) {
    std::ranges::sort(entries, [](const Entry& a, const Entry& b) {
        return a.output != b.output ? a.output < b.output : a.input < b.input;
    });
    begins_.assign(static_cast<std::size_t>(output_length) + 1, 0);
    const Entry* previous = nullptr;
    for (const Entry& entry : entries) {
        if (entry.output < 0 || entry.output >= output_length || entry.input < 0 ||
            entry.input >= input_length) {
            fail<ValueError>("[resample] entry (", entry.output, ", ", entry.input, ") outside a ",
                             output_length, " x ", input_length, " matrix");
        }
        if (previous != nullptr && previous->output == entry.output &&
            previous->input == entry.input) {
            weights_.back() += entry.weight;
            continue;
        }
        columns_.push_back(entry.input);
        weights_.push_back(entry.weight);
        begins_[static_cast<std::size_t>(entry.output) + 1] = static_cast<int>(columns_.size());
        previous = &entry;
    }
    for (std::size_t row = 1; row < begins_.size(); ++row)
        begins_[row] = std::max(begins_[row], begins_[row - 1]);
}

ResampleMatrix ResampleMatrix::transposed() const {
    std::vector<Entry> entries;
    for (int row = 0; row < output_length_; ++row) {
        for (int i = begins_[static_cast<std::size_t>(row)];
             i < begins_[static_cast<std::size_t>(row) + 1]; ++i) {
            entries.push_back({columns_[static_cast<std::size_t>(i)], row,
                               weights_[static_cast<std::size_t>(i)]});
        }
    }
    return {input_length_, output_length_, std::move(entries)};
}

}  // namespace stymo
