#pragma once

#include <span>
#include <vector>

namespace stymo {

/// A sparse matrix (output length x input length) in compressed rows, with its transpose.
class ResampleMatrix {
public:
    struct Entry {
        int output = 0;
        int input = 0;
        double weight = 0.0;
    };
    /// Entries with the same output and input add up. Throws ValueError for an entry outside the
    /// matrix.
    ResampleMatrix(int output_length, int input_length, std::vector<Entry> entries);

    [[nodiscard]] int output_length() const { return output_length_; }
    [[nodiscard]] int input_length() const { return input_length_; }
    /// Row r holds columns()[begins()[r]] .. columns()[begins()[r + 1] - 1].
    [[nodiscard]] std::span<const int> begins() const { return begins_; }
    [[nodiscard]] std::span<const int> columns() const { return columns_; }
    [[nodiscard]] std::span<const double> weights() const { return weights_; }
    [[nodiscard]] ResampleMatrix transposed() const;

private:
    int output_length_;
    int input_length_;
    std::vector<int> begins_;
    std::vector<int> columns_;
    std::vector<double> weights_;
};

}  // namespace stymo
