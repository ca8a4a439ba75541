#include "reliability/crash_states.h"

#include <algorithm>
#include <limits>
#include <optional>
#include <random>
#include <string_view>
#include <unordered_set>

#include "core/error.h"
#include "core/io/file.h"

namespace stymo {

namespace {

using Kind = Operation::Kind;

constexpr std::size_t never = std::numeric_limits<std::size_t>::max();
constexpr std::size_t most_single_choices = 48;

std::uint64_t mixed(std::uint64_t hash, std::uint64_t value) {
    // boost::hash_combine for 64 bits.
    return hash ^ (value + 0x9E3779B97F4A7C15U + (hash << 12U) + (hash >> 4U));
}

std::uint64_t hash_of(std::string_view bytes) {
    return std::hash<std::string_view>{}(bytes);
}

/// A file or a folder. Its number in the log may later be that of another one.
struct Object {
    bool is_folder = false;
    std::vector<std::size_t> writes;  ///< effects on its bytes
};

/// An entry of a folder that an operation changes; no object: it goes.
struct Entry {
    std::size_t folder;
    std::string name;
    std::optional<std::size_t> object;
};

/// An operation that changes the disk.
struct Effect {
    std::size_t moment;                ///< when the operation was done
    std::size_t on_disk = never;       ///< when it is flushed
    const Operation* write = nullptr;  ///< null for a change of names
    std::size_t object = 0;            ///< that is written to
    std::vector<Entry> entries;        ///< changed together
};

/// All operations in terms of objects, of which number 0 is the recorded folder.
class History {
public:
    explicit History(const std::vector<Operation>& operations) : objects_(1), names_(1) {
        objects_[0].is_folder = true;
        for (std::size_t i = 0; i < operations.size(); ++i) add(operations[i], i + 1);
    }
    [[nodiscard]] const std::vector<Object>& objects() const { return objects_; }
    [[nodiscard]] const std::vector<Effect>& effects() const { return effects_; }

private:
    void add(const Operation& operation, std::size_t moment) {
        switch (operation.kind) {
            case Kind::make_file:
            case Kind::make_folder:
                objects_.push_back({operation.kind == Kind::make_folder, {}});
                names_.emplace_back();
                number_[operation.number] = objects_.size() - 1;
                change(moment, {entry(operation.path, objects_.size() - 1)});
                break;
            case Kind::write:
            case Kind::resize: {
                const std::size_t object = object_of(operation.number);
                objects_[object].writes.push_back(effects_.size());
                effects_.push_back({moment, never, &operation, object, {}});
                break;
            }
            case Kind::flush:
                if (operation.number != 0) flush(object_of(operation.number), moment);
                break;
            case Kind::rename:
                change(moment, {entry(operation.path, {}),
                                entry(operation.target, object_at(operation.path))});
                break;
            case Kind::link:
                change(moment, {entry(operation.target, object_at(operation.path))});
                break;
            case Kind::remove: change(moment, {entry(operation.path, {})}); break;
        }
    }
    void change(std::size_t moment, std::vector<Entry> entries) {
        for (const Entry& entry : entries) {
            auto& names = names_[entry.folder];
            if (entry.object)
                names[entry.name] = *entry.object;
            else
                names.erase(entry.name);
        }
        effects_.push_back({moment, never, nullptr, 0, std::move(entries)});
    }
    void flush(std::size_t object, std::size_t moment) {
        flushed_[object] = moment;
        for (Effect& effect : effects_) {
            if (effect.on_disk != never) continue;
            const auto is_flushed = [&](std::size_t other) {
                const auto found = flushed_.find(other);
                return found != flushed_.end() && found->second > effect.moment;
            };
            const bool all = effect.write != nullptr
                                 ? is_flushed(effect.object)
                                 : std::ranges::all_of(effect.entries, [&](const Entry& entry) {
                                       return is_flushed(entry.folder);
                                   });
            if (all) effect.on_disk = moment;
        }
    }
    [[nodiscard]] std::size_t object_of(std::uint64_t number) const {
        const auto found = number_.find(number);
        return found == number_.end() ? 0 : found->second;
    }
    /// Folder and name of a path.
    [[nodiscard]] Entry entry(const std::string& path, std::optional<std::size_t> object) const {
        const std::filesystem::path whole = path;
        const std::filesystem::path parent = whole.parent_path();
        return {parent.empty() ? 0 : object_at(parent), whole.filename(), object};
    }
    [[nodiscard]] std::size_t object_at(const std::filesystem::path& path) const {
        std::size_t object = 0;
        for (const std::filesystem::path& name : path) {
            const auto found = names_[object].find(name);
            if (found == names_[object].end())
                fail<FileError>(path.string(), ": is used in the log and was never made");
            object = found->second;
        }
        return object;
    }

    std::vector<Object> objects_;
    std::vector<std::map<std::string, std::size_t>> names_;  ///< of folders, as programs see them
    std::vector<Effect> effects_;
    std::map<std::uint64_t, std::size_t> number_;
    std::map<std::size_t, std::size_t> flushed_;  ///< when each object was flushed last
};

/// The power cuts after one moment.
class Moment {
public:
    Moment(const History& history, std::size_t moment) : history_(history) {
        for (const Effect& effect : history.effects()) {
            if (effect.moment > moment) break;
            reached_.push_back(Reached::all);
            if (effect.on_disk > moment) pending_.push_back(reached_.size() - 1);
        }
    }

    /// Calls `visit(choice)` for each choice of what has reached the disk.
    template <class Visit>
    void for_each_choice(int random_states, std::mt19937_64& random, Visit visit) {
        const std::size_t count = pending_.size();
        const std::size_t first = count > most_single_choices ? count - most_single_choices : 0;
        const auto choose = [&](const auto& reached) {
            for (std::size_t i = 0; i < count; ++i) reached_[pending_[i]] = reached(i);
            visit(reached_);
        };
        choose([](std::size_t) { return Reached::none; });
        for (std::size_t n = first; n <= count; ++n)
            choose([&](std::size_t i) { return i < n ? Reached::all : Reached::none; });
        for (std::size_t one = first; one < count; ++one) {
            choose([&](std::size_t i) { return i == one ? Reached::all : Reached::none; });
            for (const Reached partly : {Reached::none, Reached::half, Reached::zeros}) {
                if (partly != Reached::none && !is_write(one)) continue;
                choose([&](std::size_t i) { return i == one ? partly : Reached::all; });
            }
        }
        for (const Reached bytes : {Reached::none, Reached::half, Reached::zeros})
            choose([&](std::size_t i) { return is_write(i) ? bytes : Reached::all; });
        choose([&](std::size_t i) { return is_write(i) ? Reached::all : Reached::none; });
        for (int state = 0; state < random_states && count > 0; ++state)
            choose([&](std::size_t i) {
                const auto any = random() % 4;
                if (!is_write(i)) return any % 2 == 0 ? Reached::all : Reached::none;
                return static_cast<Reached>(any);
            });
    }

    /// The files that a choice leaves.
    [[nodiscard]] DiskState state(const std::vector<Reached>& reached,
                                  const std::function<bool(const std::string&)>& counts) const {
        std::vector<std::map<std::string, std::size_t>> names(history_.objects().size());
        for (std::size_t i = 0; i < reached.size(); ++i) {
            if (reached[i] == Reached::none) continue;
            for (const Entry& entry : history_.effects()[i].entries) {
                auto& folder = names[entry.folder];
                if (entry.object)
                    folder[entry.name] = *entry.object;
                else
                    folder.erase(entry.name);
            }
        }
        DiskState state;
        collect(0, "", names, reached, counts, state);
        return state;
    }

private:
    [[nodiscard]] bool is_write(std::size_t i) const {
        return history_.effects()[pending_[i]].write != nullptr;
    }
    void collect(std::size_t folder, const std::string& path,
                 const std::vector<std::map<std::string, std::size_t>>& names,
                 const std::vector<Reached>& reached,
                 const std::function<bool(const std::string&)>& counts, DiskState& state) const {
        for (const auto& [name, object] : names[folder]) {
            const std::string place = path.empty() ? name : path + "/" + name;
            const Object& found = history_.objects()[object];
            if (found.is_folder) {
                collect(object, place, names, reached, counts, state);
            } else if (counts(place)) {
                FileVersion version;
                for (const std::size_t write : found.writes)
                    if (write < reached.size())
                        version.add(*history_.effects()[write].write, reached[write]);
                state.emplace(place, std::move(version));
            }
        }
    }

    const History& history_;
    std::vector<Reached> reached_;      ///< of every effect so far
    std::vector<std::size_t> pending_;  ///< effects that are not flushed
};

std::uint64_t identity_of(const DiskState& state) {
    std::uint64_t hash = 0;
    for (const auto& [path, version] : state)
        hash = mixed(mixed(hash, hash_of(path)), version.identity());
    return hash;
}

}  // namespace

void FileVersion::add(const Operation& operation, Reached reached) {
    if (reached == Reached::none) return;
    writes_.emplace_back(&operation, reached);
    identity_ = mixed(mixed(identity_, static_cast<std::uint64_t>(reached)), operation.order);
}

std::string FileVersion::bytes() const {
    std::string result;
    for (const auto& [write, reached] : writes_) {
        if (write->kind == Kind::resize) {
            if (reached == Reached::all) result.resize(write->offset);
            continue;
        }
        const std::size_t size =
            reached == Reached::half ? write->bytes.size() / 2 : write->bytes.size();
        if (result.size() < write->offset + size) result.resize(write->offset + size);
        if (reached == Reached::zeros) {
            std::fill_n(result.begin() + static_cast<std::ptrdiff_t>(write->offset), size, '\0');
        } else {
            std::copy_n(write->bytes.begin(), size,
                        result.begin() + static_cast<std::ptrdiff_t>(write->offset));
        }
    }
    return result;
}

PowerCutCounts visit_crash_states(
    const std::vector<Operation>& operations, const PowerCuts& cuts,
    const std::function<void(const DiskState& state, std::size_t promises)>& visit) {
    const History history(operations);
    std::mt19937_64 random(1);
    std::unordered_set<std::uint64_t> seen;
    PowerCutCounts counts;
    for (std::size_t time = 0; time <= operations.size(); ++time) {
        const auto made = static_cast<std::size_t>(std::ranges::count_if(
            cuts.promises, [&](std::size_t promise) { return promise <= time; }));
        Moment moment(history, time);
        moment.for_each_choice(cuts.random_states, random,
                               [&](const std::vector<Reached>& reached) {
                                   ++counts.cuts;
                                   const DiskState state = moment.state(reached, cuts.counts);
                                   if (!seen.insert(mixed(identity_of(state), made)).second) return;
                                   ++counts.states;
                                   visit(state, made);
                               });
    }
    return counts;
}

std::vector<Operation> without_flushes(std::vector<Operation> operations) {
    // They stay without effect, so that the moments keep their numbers.
    for (Operation& operation : operations)
        if (operation.kind == Kind::flush) operation.number = 0;
    return operations;
}

WholeVersions whole_versions(const std::vector<Operation>& operations) {
    const History history(operations);
    WholeVersions versions;
    for (const Effect& effect : history.effects()) {
        if (effect.entries.size() != 2 || !effect.entries.back().object) continue;
        const Object& object = history.objects()[*effect.entries.back().object];
        if (object.is_folder) continue;
        FileVersion version;
        for (const std::size_t write : object.writes)
            if (history.effects()[write].moment < effect.moment)
                version.add(*history.effects()[write].write, Reached::all);
        versions[effect.entries.back().name].insert(version.identity());
    }
    return versions;
}

void restore(const DiskState& state, const std::filesystem::path& folder) {
    for (const auto& [path, version] : state) {
        std::filesystem::create_directories((folder / path).parent_path());
        write_file(folder / path, version.bytes(), Durability::none);
    }
}

}  // namespace stymo
