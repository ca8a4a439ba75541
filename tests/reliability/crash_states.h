#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "reliability/operation_log.h"

namespace stymo {

/// How much of an operation is on the disk after a power cut.
enum class Reached { all, none, half, zeros };

/// A file after a power cut: the writes to it, and what of each is on the disk.
class FileVersion {
public:
    /// `operation` must outlive this.
    void add(const Operation& operation, Reached reached);
    /// Equal for files to which the same operations were done, as far as they reached the disk.
    [[nodiscard]] std::uint64_t identity() const { return identity_; }
    [[nodiscard]] std::string bytes() const;

private:
    std::vector<std::pair<const Operation*, Reached>> writes_;
    std::uint64_t identity_ = 0;
};

/// Files by their paths, as a computer finds them when it starts again.
using DiskState = std::map<std::string, FileVersion>;

/// Which power cuts to look at.
struct PowerCuts {
    /// Files that belong to a state.
    std::function<bool(const std::string& path)> counts;
    /// Moments (numbers of operations before the cut) from which on the program promises more. A
    /// state that is fine before may be a loss after them.
    std::vector<std::size_t> promises;
    int random_states = 16;  ///< for each moment
};

struct PowerCutCounts {
    std::int64_t cuts = 0;
    std::int64_t states = 0;  ///< distinct, for each number of promises
};

/// Calls `visit(state, promises)` for everything that the disk may hold if the power fails after
/// some of `operations`, once for every distinct state and number of promises made.
///
/// A write reaches the disk at the latest when its file is flushed, and a name when its folder is.
/// Until then the disk may have any of these operations in any order; of a write it may also have
/// the first half, or zeros in its place. All these choices are too many. Looked at, for each
/// moment, are those
///
/// - with the first n operations that were not flushed, for every n (this is also what a process
///   that is killed leaves behind, if n is all),
/// - with all of them but one, with half or zeros of one, and with one of them,
/// - with all names and no bytes, zeros for bytes, or half of the bytes, and with all bytes and no
///   names,
/// - with random choices among them.
///
/// Where more than 48 operations are not flushed, n and "one" are among the last 48.
PowerCutCounts visit_crash_states(
    const std::vector<Operation>& operations, const PowerCuts& cuts,
    const std::function<void(const DiskState& state, std::size_t promises)>& visit);

/// The complete versions of each file that was written aside and renamed: identities by file name.
using WholeVersions = std::map<std::string, std::set<std::uint64_t>>;
[[nodiscard]] WholeVersions whole_versions(const std::vector<Operation>& operations);

/// The same operations as if the program had flushed nothing.
[[nodiscard]] std::vector<Operation> without_flushes(std::vector<Operation> operations);

/// Writes the files of a state below `folder`.
void restore(const DiskState& state, const std::filesystem::path& folder);

}  // namespace stymo
