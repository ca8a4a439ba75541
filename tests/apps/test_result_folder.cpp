#include <catch2/catch.hpp>
#include <optional>

#include "apps/common/result_folder.h"
#include "core/error.h"
#include "core/io/file.h"
#include "core/io/scratch_folder.h"

using namespace stymo;
using Catch::Matchers::Contains;

TEST_CASE("a folder is locked once at a time") {
    const ScratchFolder folder;
    std::optional<FolderLock> lock(folder.path());
    CHECK_THROWS_WITH(FolderLock(folder.path()),
                      Contains(folder.path().string() + ": another process is working"));
    lock.reset();
    CHECK_NOTHROW(FolderLock(folder.path()));
}

TEST_CASE("a folder that is not there cannot be locked") {
    const ScratchFolder folder;
    CHECK_THROWS_WITH(FolderLock(folder / "none"), Contains("none/.lock: cannot be written"));
}

TEST_CASE("a folder in which a run died before its settings were written can be used again") {
    const ScratchFolder folder;
    write_file(folder / ".lock", "");
    write_file(folder / ".settings.4711-0.part.json", "{");
    CHECK_NOTHROW(ResultFolder::require_own(folder.path()));
    write_file(folder / ".other", "");
    CHECK_THROWS_WITH(ResultFolder::require_own(folder.path()), Contains("exists already"));
}

TEST_CASE("ranks of a run without an output folder differ in settings or photos") {
    const std::vector<std::string> photos{"1", "2"}, fewer{"1"};
    const JsonValue settings = to_json(Settings{{"--ids", "0-1"}, {"--steps", 3}});
    CHECK(settings.text() == R"({"--ids":"0-1","--steps":3})");
    const CommonState state = common_state(settings, photos);
    CHECK(state == common_state(settings, photos));
    CHECK(state != common_state(settings, fewer));
    CHECK(state != common_state(to_json(Settings{{"--ids", "0-1"}, {"--steps", 4}}), photos));
}
