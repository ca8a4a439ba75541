#include <catch2/catch.hpp>
#include <filesystem>
#include <fstream>

#include "core/error.h"
#include "core/io/file.h"
#include "core/io/folder_in_progress.h"
#include "core/io/scratch_folder.h"

using namespace stymo;
using Catch::Matchers::Contains;

TEST_CASE("a text comes back as it was written and nothing is left beside it") {
    const ScratchFolder folder;
    const std::string text("one\ntwo\r\n\0three", 16);
    write_file(folder / "a.txt", text);
    write_file(folder / "a.txt", text);
    CHECK(read_file(folder / "a.txt") == text);
    CHECK(folder.file_count() == 1);
}

TEST_CASE("a file is read to its end, whatever size the system says it has") {
    // Those of /proc are said to be empty.
    CHECK_THAT(read_file("/proc/self/status"), Contains("VmPeak"));
    const ScratchFolder folder;
    for (const std::size_t size : {0U, 1U, 4095U, 4096U, 4097U, 300'000U}) {
        const std::string text(size, 'a');
        write_file(folder / "a.txt", text);
        CHECK(read_file(folder / "a.txt") == text);
    }
}

TEST_CASE("a missing file and a folder are refused as texts") {
    const ScratchFolder folder;
    CHECK_THROWS_WITH(read_file(folder / "none.txt"),
                      Contains("none.txt: cannot be read (No such file or directory)"));
    CHECK_THROWS_AS(read_file(folder.path()), FileError);
}

TEST_CASE("a write that fails leaves the old file and no temporary one") {
    const ScratchFolder folder;
    write_file(folder / "a.txt", "old");
    CHECK_THROWS_AS(write_whole(folder / "a.txt",
                                [](const std::filesystem::path& temporary) {
                                    CHECK(temporary.extension() == ".txt");
                                    std::ofstream(temporary) << "half";
                                    fail<ValueError>("stopped");
                                }),
                    ValueError);
    CHECK(read_file(folder / "a.txt") == "old");
    CHECK(folder.file_count() == 1);
}

TEST_CASE("a write of a file during another one leaves both whole, and the last one stays") {
    const ScratchFolder folder;
    write_whole(folder / "a.txt", [&](const std::filesystem::path& temporary) {
        std::ofstream(temporary) << "outer";
        write_file(folder / "a.txt", "inner", Durability::none);
        CHECK(read_file(folder / "a.txt") == "inner");
    });
    CHECK(read_file(folder / "a.txt") == "outer");
    CHECK(folder.file_count() == 1);
}

TEST_CASE("the longest name of a file can be written") {
    const ScratchFolder folder;
    const std::string name = std::string(251, 'a') + ".png";
    write_file(folder / name, "whole", Durability::none);
    CHECK(read_file(folder / name) == "whole");
}

TEST_CASE("what has no end is no file") {
    CHECK_THROWS_WITH(read_file("/dev/zero"), Catch::Contains("has no end"));
    CHECK(read_file("/dev/null").empty());
}

TEST_CASE("a folder that replaces another one does so whole") {
    const ScratchFolder folder;
    const auto target = folder / "run";
    for (const char* text : {"old", "new"}) {
        FolderInProgress next(target);
        for (const char* name : {"a.txt", "b.txt"})
            write_file(next.path() / name, text, Durability::none);
        next.finish();
    }
    CHECK(read_file(target / "a.txt") == "new");
    CHECK(read_file(target / "b.txt") == "new");
    CHECK(std::distance(std::filesystem::directory_iterator(folder.path()), {}) == 1);
}

TEST_CASE("a folder that is replaced stays where a link says, with its permissions") {
    namespace fs = std::filesystem;
    const ScratchFolder folder;
    const auto real = folder / "real", link = folder / "link";
    fs::create_directory(real);
    fs::create_directory_symlink("real", link);
    fs::permissions(real, fs::perms::owner_all);
    for (const auto& target : {link, real}) {
        FolderInProgress next(target);
        write_file(next.path() / "a.txt", target.string(), Durability::none);
        next.finish();
        CHECK(fs::is_symlink(link));
        CHECK(read_file(real / "a.txt") == target.string());
        CHECK(fs::status(real).permissions() == fs::perms::owner_all);
    }
}

TEST_CASE("folders in progress of one target do not meet, and leave nothing beside it") {
    const ScratchFolder folder;
    const auto target = folder / "run";
    {
        FolderInProgress one(target), two(target);
        write_file(one.path() / "one.png", "one", Durability::none);
        write_file(two.path() / "two.png", "two", Durability::none);
        one.finish();
        CHECK_FALSE(std::filesystem::exists(target / "two.png"));
        two.finish();
        const FolderInProgress given_up(target);
        write_file(given_up.path() / "three.png", "three", Durability::none);
    }
    CHECK(read_file(target / "one.png") == "one");
    CHECK(read_file(target / "two.png") == "two");
    CHECK_FALSE(std::filesystem::exists(target / "three.png"));
    CHECK(std::distance(std::filesystem::directory_iterator(folder.path()), {}) == 1);
}

TEST_CASE("what killed processes left half-written is removed, and nothing else") {
    const ScratchFolder folder;
    for (const char* name : {".a.12.part.txt", ".a.12-3.part", "..a.1.2.part.png"})
        write_file(folder / name, "half", Durability::none);
    for (const char* name : {"a.12.part.txt", ".a.part.txt", ".a.x.part", ".part", "a.txt"})
        write_file(folder / name, "kept", Durability::none);
    remove_temporary_files(folder.path());
    CHECK(folder.file_count() == 5);
    CHECK_FALSE(std::filesystem::exists(folder / ".a.12.part.txt"));
}

TEST_CASE("writing into a missing folder is refused") {
    const ScratchFolder folder;
    CHECK_THROWS_WITH(write_file(folder / "none/a.txt", "x"),
                      Contains("cannot be written (No such file or directory)"));
    CHECK_THROWS_AS(write_file(folder.path(), "x"), FileError);
}

TEST_CASE("files and folders are flushed to the disk; what is not there is named") {
    const ScratchFolder folder;
    write_file(folder / "text.txt", "text");
    CHECK_NOTHROW(flush_to_disk(folder / "text.txt"));
    require_writable_folder(folder / "a/b");
    CHECK_NOTHROW(flush_to_disk(folder / "."));
    CHECK_NOTHROW(flush_names(folder / "a"));
    CHECK_THROWS_WITH(flush_names(folder / "none"),
                      Contains("none: cannot be written to the disk"));
    CHECK_THROWS_WITH(flush_to_disk(folder / "none"),
                      Contains("none: cannot be written to the disk"));
}

TEST_CASE("lines are appended to a file that need not exist; what cannot be written is refused") {
    const ScratchFolder folder;
    for (const Durability durability : {Durability::crash_safe, Durability::none})
        append_line(folder / "lines", "one more", durability);
    CHECK(read_file(folder / "lines") == "one more\none more\n");
    CHECK_THROWS_WITH(append_line(folder.path(), "x", Durability::crash_safe),
                      Contains("cannot be written (Is a directory)"));
    CHECK_THROWS_WITH(append_line("/dev/full", "x", Durability::none),
                      Contains("/dev/full: cannot be written (No space left on device)"));
}

TEST_CASE("a folder is made with its parents unless a file is in the way") {
    const ScratchFolder folder;
    require_writable_folder(folder / "a/b/c");
    require_writable_folder(folder / "a/b/c");
    CHECK(std::filesystem::is_directory(folder / "a/b/c"));
    write_file(folder / "file", "x");
    CHECK_THROWS_AS(require_writable_folder(folder / "file"), FileError);
    CHECK_THROWS_AS(require_writable_folder(folder / "file/below"), FileError);
}
