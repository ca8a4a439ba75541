#include <catch2/catch.hpp>
#include <optional>

#include "apps/common/result_folder.h"
#include "core/error.h"
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
