#include "reliability/operation_log.h"

#include <map>
#include <sstream>

#include "core/error.h"
#include "core/io/file.h"

namespace stymo {

namespace {

using Kind = Operation::Kind;

Operation operation_of(const std::string& line) {
    static const std::map<std::string, Kind> kinds{
        {"make", Kind::make_file}, {"folder", Kind::make_folder}, {"write", Kind::write},
        {"size", Kind::resize},    {"flush", Kind::flush},        {"rename", Kind::rename},
        {"link", Kind::link},      {"remove", Kind::remove}};
    std::istringstream words(line);
    std::string name;
    words >> name;
    const auto kind = kinds.find(name);
    if (kind == kinds.end()) fail<FileError>("not an operation: ", line);
    Operation operation{.kind = kind->second, .path = {}, .target = {}, .bytes = {}};
    std::size_t size = 0;
    switch (operation.kind) {
        case Kind::make_file:
        case Kind::make_folder: words >> operation.number >> operation.path; break;
        case Kind::write: words >> operation.number >> operation.offset >> size; break;
        case Kind::resize: words >> operation.number >> operation.offset; break;
        case Kind::flush: words >> operation.number; break;
        case Kind::rename:
        case Kind::link: words >> operation.path >> operation.target; break;
        case Kind::remove: words >> operation.path; break;
    }
    if (!words) fail<FileError>("not an operation: ", line);
    operation.bytes.resize(size);
    return operation;
}

}  // namespace

std::vector<Operation> read_operation_log(const std::filesystem::path& log) {
    std::istringstream stream(read_file(log));
    std::vector<Operation> operations;
    for (std::string line; std::getline(stream, line);) {
        operations.push_back(operation_of(line));
        operations.back().order = operations.size();
        std::string& bytes = operations.back().bytes;
        if (!stream.read(bytes.data(), static_cast<std::streamsize>(bytes.size())))
            fail<FileError>(log.string(), ": ends within a write");
    }
    return operations;
}

}  // namespace stymo
