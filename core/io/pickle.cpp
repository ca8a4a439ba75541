#include "core/io/pickle.h"

#include <algorithm>
#include <bit>
#include <cstring>
#include <map>
#include <utility>

#include "core/error.h"

namespace stymo {
namespace {

using Kind = PickleNode::Kind;
using Text = std::shared_ptr<const std::string>;

/// Opcodes of Lib/pickle.py that protocols 2 to 5 write.
enum class Opcode : unsigned char {
    mark = '(',
    stop = '.',
    pop = '0',
    pop_mark = '1',
    duplicate = '2',
    float_number = 'G',
    int32 = 'J',
    uint8 = 'K',
    uint16 = 'M',
    none = 'N',
    reference = 'Q',
    reduce = 'R',
    byte_text = 'T',
    short_byte_text = 'U',
    text = 'X',
    append = 'a',
    build = 'b',
    name = 'c',
    dictionary = 'd',
    empty_dictionary = '}',
    appends = 'e',
    get = 'h',
    long_get = 'j',
    list = 'l',
    empty_list = ']',
    put = 'q',
    long_put = 'r',
    set_item = 's',
    tuple = 't',
    empty_tuple = ')',
    set_items = 'u',
    bytes = 'B',
    short_bytes = 'C',
    protocol = 0x80,
    new_object = 0x81,
    tuple1 = 0x85,
    tuple2 = 0x86,
    tuple3 = 0x87,
    new_true = 0x88,
    new_false = 0x89,
    long1 = 0x8a,
    long4 = 0x8b,
    short_text = 0x8c,
    text8 = 0x8d,
    bytes8 = 0x8e,
    empty_set = 0x8f,
    add_items = 0x90,
    frozen_set = 0x91,
    new_object_with_keywords = 0x92,
    stack_name = 0x93,
    memoize = 0x94,
    frame = 0x95,
};

}  // namespace

/// The stack machine of the pickle protocol.
class Pickle::Reader {
public:
    Reader(std::string_view bytes, const std::string& source,
           const std::function<bool(const std::string&)>& allowed, std::deque<PickleNode>& nodes)
        : bytes_(bytes), source_(source), allowed_(allowed), nodes_(nodes) {}

    PickleValue read() {
        while (true) {
            const auto opcode = static_cast<Opcode>(number<std::uint8_t>());
            if (opcode == Opcode::stop) return pop();
            if (!read_constant(opcode) && !read_memo(opcode) && !read_container(opcode) &&
                !read_object(opcode))
                refuse("code ", static_cast<int>(opcode), " at byte ", position_ - 1);
        }
    }

    [[nodiscard]] std::size_t position() const { return position_; }

private:
    template <class... Parts>
    [[noreturn]] void refuse(const Parts&... parts) const {
        fail<FileError>(source_, ": not a readable pickle (", parts..., ")");
    }

    std::string_view take(std::uint64_t count) {
        if (count > bytes_.size() - position_) refuse("truncated");
        const std::string_view taken = bytes_.substr(position_, count);
        position_ += count;
        return taken;
    }

    template <class Number>
    Number number() {
        Number result;
        std::memcpy(&result, take(sizeof result).data(), sizeof result);
        return result;
    }

    std::string_view line() {
        const std::size_t end = bytes_.find('\n', position_);
        if (end == std::string_view::npos) refuse("truncated");
        const std::string_view taken = take(end - position_);
        ++position_;
        return taken;
    }

    void push(PickleValue value) { stack_.push_back(std::move(value)); }
    void push_text(std::string_view text) { push(std::make_shared<const std::string>(text)); }
    void push_node(PickleNode node) {
        nodes_.push_back(std::move(node));
        push(&nodes_.back());
    }

    /// Elements below the last mark belong to an object that is still under construction.
    [[nodiscard]] std::size_t bottom() const { return marks_.empty() ? 0 : marks_.back(); }
    void require_items(std::size_t count) const {
        if (stack_.size() < bottom() + count) refuse("takes more than it has put");
    }

    PickleValue pop() {
        require_items(1);
        PickleValue value = std::move(stack_.back());
        stack_.pop_back();
        return value;
    }

    std::vector<PickleValue> pop_last(std::size_t count) {
        require_items(count);
        const auto first = stack_.end() - static_cast<std::ptrdiff_t>(count);
        std::vector<PickleValue> items(std::make_move_iterator(first),
                                       std::make_move_iterator(stack_.end()));
        stack_.erase(first, stack_.end());
        return items;
    }

    std::vector<PickleValue> pop_to_mark() {
        if (marks_.empty()) refuse("lacks a mark");
        std::vector<PickleValue> items = pop_last(stack_.size() - marks_.back());
        marks_.pop_back();
        return items;
    }

    /// The node on top of the stack, to be changed.
    PickleNode& top_node() {
        require_items(1);
        const auto* node = std::get_if<const PickleNode*>(&stack_.back());
        if (node == nullptr) refuse("fills what is no container");
        return const_cast<PickleNode&>(**node);  // one of nodes_, which are ours
    }

    void add_to_top(std::vector<PickleValue> items, std::initializer_list<Kind> kinds) {
        PickleNode& node = top_node();
        const bool fits = std::ranges::find(kinds, node.kind) != kinds.end();
        const bool pairs = node.kind == Kind::dictionary || node.kind == Kind::call;
        if (!fits || (pairs && items.size() % 2 != 0))
            refuse("fills a container that does not fit");
        node.items.insert(node.items.end(), std::make_move_iterator(items.begin()),
                          std::make_move_iterator(items.end()));
    }

    [[nodiscard]] std::string allowed_name(std::string_view module,
                                           std::string_view function) const {
        std::string name = std::string(module) + "." + std::string(function);
        if (!allowed_(name))
            fail<FileError>(source_, ": refuses to load \"", name,
                            "\": not a tensor or container; in Python, save the state dict alone");
        return name;
    }

    /// A two's complement integer of any length.
    static PickleValue integer(std::string_view digits) {
        double value = 0.0;
        std::uint64_t bits = 0;
        const bool negative =
            !digits.empty() && (static_cast<unsigned char>(digits.back()) & 0x80U) != 0;
        for (std::size_t i = digits.size(); i-- > 0;) {
            const unsigned digit = static_cast<unsigned char>(digits[i]);
            value = value * 256.0 + (negative ? 255.0 - digit : digit);
            bits = bits << 8 | digit;
        }
        if (digits.size() > sizeof bits) return negative ? -value - 1.0 : value;
        const std::size_t unused = 8 * (sizeof bits - digits.size());
        return digits.empty() ? std::int64_t{0}
                              : static_cast<std::int64_t>(bits << unused) >> unused;
    }

    bool read_constant(Opcode opcode) {
        switch (opcode) {
            case Opcode::protocol:
                if (const int version = number<std::uint8_t>(); version > 5)
                    refuse("protocol ", version);
                return true;
            case Opcode::frame: static_cast<void>(number<std::uint64_t>()); return true;
            case Opcode::none: push(std::monostate()); return true;
            case Opcode::new_true: push(true); return true;
            case Opcode::new_false: push(false); return true;
            case Opcode::int32: push(std::int64_t{number<std::int32_t>()}); return true;
            case Opcode::uint8: push(std::int64_t{number<std::uint8_t>()}); return true;
            case Opcode::uint16: push(std::int64_t{number<std::uint16_t>()}); return true;
            case Opcode::long1: push(integer(take(number<std::uint8_t>()))); return true;
            case Opcode::long4: push(integer(take(number<std::uint32_t>()))); return true;
            case Opcode::float_number:
                push(std::bit_cast<double>(__builtin_bswap64(number<std::uint64_t>())));
                return true;
            case Opcode::short_text:
            case Opcode::short_byte_text:
            case Opcode::short_bytes: push_text(take(number<std::uint8_t>())); return true;
            case Opcode::text:
            case Opcode::byte_text:
            case Opcode::bytes: push_text(take(number<std::uint32_t>())); return true;
            case Opcode::text8:
            case Opcode::bytes8: push_text(take(number<std::uint64_t>())); return true;
            default: return false;
        }
    }

    bool read_memo(Opcode opcode) {
        switch (opcode) {
            case Opcode::put: memorise(number<std::uint8_t>()); return true;
            case Opcode::long_put: memorise(number<std::uint32_t>()); return true;
            case Opcode::memoize: memorise(memo_.size()); return true;
            case Opcode::get: push(remembered(number<std::uint8_t>())); return true;
            case Opcode::long_get: push(remembered(number<std::uint32_t>())); return true;
            case Opcode::duplicate:
                require_items(1);
                push(PickleValue(stack_.back()));
                return true;
            case Opcode::pop: static_cast<void>(pop()); return true;
            case Opcode::mark: marks_.push_back(stack_.size()); return true;
            case Opcode::pop_mark: static_cast<void>(pop_to_mark()); return true;
            default: return false;
        }
    }

    void memorise(std::uint64_t key) {
        require_items(1);
        memo_[key] = stack_.back();
    }

    [[nodiscard]] const PickleValue& remembered(std::uint64_t key) const {
        const auto found = memo_.find(key);
        if (found == memo_.end()) refuse("refers to what it has not stored");
        return found->second;
    }

    bool read_container(Opcode opcode) {
        switch (opcode) {
            case Opcode::empty_list: push_node({.kind = Kind::list}); return true;
            case Opcode::empty_tuple: push_node({.kind = Kind::tuple}); return true;
            case Opcode::empty_set: push_node({.kind = Kind::set}); return true;
            case Opcode::empty_dictionary: push_node({.kind = Kind::dictionary}); return true;
            case Opcode::list: push_node({.kind = Kind::list, .items = pop_to_mark()}); return true;
            case Opcode::tuple:
                push_node({.kind = Kind::tuple, .items = pop_to_mark()});
                return true;
            case Opcode::frozen_set:
                push_node({.kind = Kind::set, .items = pop_to_mark()});
                return true;
            case Opcode::tuple1:
                push_node({.kind = Kind::tuple, .items = pop_last(1)});
                return true;
            case Opcode::tuple2:
                push_node({.kind = Kind::tuple, .items = pop_last(2)});
                return true;
            case Opcode::tuple3:
                push_node({.kind = Kind::tuple, .items = pop_last(3)});
                return true;
            case Opcode::dictionary: {
                auto items = pop_to_mark();
                push_node({.kind = Kind::dictionary});
                add_to_top(std::move(items), {Kind::dictionary});
                return true;
            }
            case Opcode::append: add_to_top(pop_last(1), {Kind::list}); return true;
            case Opcode::appends: add_to_top(pop_to_mark(), {Kind::list}); return true;
            case Opcode::add_items: add_to_top(pop_to_mark(), {Kind::set}); return true;
            case Opcode::set_item:
                add_to_top(pop_last(2), {Kind::dictionary, Kind::call});
                return true;
            case Opcode::set_items:
                add_to_top(pop_to_mark(), {Kind::dictionary, Kind::call});
                return true;
            default: return false;
        }
    }

    bool read_object(Opcode opcode) {
        switch (opcode) {
            case Opcode::name: {
                const std::string_view module = line();
                push_node({.kind = Kind::name, .name = allowed_name(module, line())});
                return true;
            }
            case Opcode::stack_name: {
                const auto parts = pop_last(2);
                const Text* module = std::get_if<Text>(parts.data());
                const Text* function = std::get_if<Text>(&parts[1]);
                if (module == nullptr || function == nullptr) refuse("a name is no text");
                push_node({.kind = Kind::name, .name = allowed_name(**module, **function)});
                return true;
            }
            case Opcode::reduce:
            case Opcode::new_object: call(pop_last(2)); return true;
            case Opcode::new_object_with_keywords: {
                const PickleValue keywords = pop();
                call(pop_last(2));
                return true;
            }
            case Opcode::build:
                // Attributes of an object ("_metadata" of a state dict) say nothing about its
                // tensors.
                static_cast<void>(pop_last(1));
                if (top_node().kind != Kind::call) refuse("gives attributes to what is no object");
                return true;
            case Opcode::reference:
                push_node({.kind = Kind::reference, .items = pop_last(1)});
                return true;
            default: return false;
        }
    }

    void call(const std::vector<PickleValue>& function_and_arguments) {
        const auto* function = std::get_if<const PickleNode*>(function_and_arguments.data());
        const auto* arguments = std::get_if<const PickleNode*>(&function_and_arguments[1]);
        if (function == nullptr || (*function)->kind != Kind::name || arguments == nullptr ||
            (*arguments)->kind != Kind::tuple)
            refuse("calls what has no name");
        push_node({.kind = Kind::call, .name = (*function)->name, .arguments = *arguments});
    }

    std::string_view bytes_;
    const std::string& source_;
    const std::function<bool(const std::string&)>& allowed_;
    std::deque<PickleNode>& nodes_;
    std::size_t position_ = 0;
    std::vector<PickleValue> stack_;
    std::vector<std::size_t> marks_;
    std::map<std::uint64_t, PickleValue> memo_;
};

Pickle::Pickle(std::string_view bytes, const std::string& source,
               const std::function<bool(const std::string&)>& allowed) {
    Reader reader(bytes, source, allowed, nodes_);
    root_ = reader.read();
    length_ = reader.position();
}

}  // namespace stymo
