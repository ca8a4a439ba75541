#include <array>
#include <catch2/catch.hpp>
#include <opencv2/core.hpp>
#include <opencv2/videoio.hpp>

#include "core/error.h"
#include "core/io/file.h"
#include "core/io/film.h"
#include "core/io/scratch_folder.h"
#include "support/mp3_frame.h"

namespace film_tests {

using namespace stymo;
using Catch::Matchers::Contains;

namespace {

/// A grey frame that grows lighter with its number.
Tensor grey_frame(int number) {
    return Tensor::full({36, 50, 3}, 0.1 + 0.05 * number);
}

/// Motion JPEG, which can be read as far as it is there.
void write_avi(const std::filesystem::path& path, int frames) {
    cv::VideoWriter writer(path.string(), cv::CAP_OPENCV_MJPEG,
                           cv::VideoWriter::fourcc('M', 'J', 'P', 'G'), 20.0, {64, 48});
    for (int i = 0; i < frames; ++i) {
        cv::Mat image(48, 64, CV_8UC3);
        cv::randu(image, 0, 255);
        writer.write(image);
    }
}

void write_grey(const std::filesystem::path& path, int frames) {
    FilmWriter writer(path, path, 36, 50, 20.0);
    for (int i = 0; i < frames; ++i) writer.add(grey_frame(i));
    writer.finish();
}

}  // namespace

TEST_CASE("A film has the frames that were written, one after the other") {
    const ScratchFolder folder;
    write_grey(folder / "a.mp4", 9);
    FilmReader reader(folder / "a.mp4");
    CHECK(reader.frames_per_second() == Approx(20.0));
    CHECK(reader.stated_frames() == 9);
    CHECK(reader.skip());
    for (int i = 1; i < 9; ++i) {
        const std::optional<Tensor> frame = reader.next();
        REQUIRE(frame);
        CHECK(frame->shape() == Shape{36, 50, 3});
        CHECK(frame->values<float>()[300] == Approx(0.1 + 0.05 * i).margin(0.02));
    }
    CHECK_FALSE(reader.next());
    CHECK(FilmReader(folder / "a.mp4", 25).next()->shape() == Shape{18, 25, 3});

    FilmWriter writer(folder / "b.mp4", folder / "b.mp4", 36, 50, 20.0);
    for (const Shape& other : {Shape{18, 25, 3}, Shape{50, 36, 3}, Shape{36, 50, 1}})
        CHECK_THROWS_AS(writer.add(Tensor::zeros(other)), ShapeError);
}

TEST_CASE("Films that are cut off and files that are no films are refused") {
    const ScratchFolder folder;
    write_avi(folder / "whole.avi", 40);
    const std::string bytes = read_file(folder / "whole.avi");
    write_file(folder / "cut.avi", bytes.substr(0, bytes.size() / 2));
    write_file(folder / "text.mp4", "no film");
    FilmReader cut(folder / "cut.avi");
    CHECK_THROWS_WITH(
        [&] {
            while (cut.skip()) {
            }
        }(),
        Contains("cut.avi: ends after ") && Contains(" of 40 frames, so it was cut off"));
    CHECK_THROWS_WITH(FilmReader(folder / "text.mp4"), Contains("text.mp4: no film"));
    CHECK_THROWS_WITH(FilmReader(folder / "none.mp4"), Contains("none.mp4: no such file"));
    CHECK_THROWS_WITH(FilmReader(folder.path()), Contains(": is a folder, not a film"));
    CHECK_THROWS_AS(FilmReader(folder / std::string(300, 'a')), FileError);
}

TEST_CASE("A list of films is no film, and a colon in a name is part of it") {
    const ScratchFolder folder;
    write_grey(folder / "a.mp4", 2);
    write_file(folder / "list.mp4", "ffconcat version 1.0\nfile a.mp4\n");
    write_file(folder / "play.mp4", "#EXTM3U\n#EXT-X-TARGETDURATION:1\n#EXTINF:1,\na.mp4\n");
    for (const char* name : {"list.mp4", "play.mp4"}) {
        CHECK_THROWS_WITH(FilmReader(folder / name), Contains("no film"));
        CHECK_THROWS_AS(add_sound(folder / name, folder / "a.mp4"), FileError);
    }
    const std::filesystem::path before = std::filesystem::current_path();
    std::filesystem::current_path(folder.path());
    write_grey("film:1.mp4", 2);
    CHECK(FilmReader("film:1.mp4").next());
    std::filesystem::current_path(before);
}

TEST_CASE("A film that cannot be written names itself and the cause") {
    const ScratchFolder folder;
    CHECK_THROWS_WITH(write_grey(folder / "none/a.mp4", 1),
                      Contains("none/a.mp4: cannot be written (No such file or directory)"));
}

std::filesystem::path golden(const char* name) {
    return std::filesystem::path(STYMO_SOURCE_DIR) / "tests/golden/films" / name;
}

TEST_CASE("The colours of a film are those of the colour space that it names") {
    const Tensor frame = FilmReader(golden("bt709.mp4")).next().value();
    REQUIRE(frame.shape() == Shape{32, 96, 3});
    const std::array<std::array<double, 3>, 3> bars{
        {{200.0, 150.0, 120.0}, {200.0, 50.0, 50.0}, {50.0, 200.0, 50.0}}};
    for (std::size_t bar = 0; bar < bars.size(); ++bar)
        for (std::size_t c = 0; c < 3; ++c)
            CHECK(255.0 * static_cast<double>(
                              frame.values<float>()[((16 * 96) + 32 * bar + 16) * 3 + c]) ==
                  Approx(bars[bar][c]).margin(3.5));
}

TEST_CASE("A film whose file does not count its frames is read to its end") {
    FilmReader film(golden("sparse.webm"));
    int frames = 0;
    while (film.next()) ++frames;
    CHECK(frames == 6);
}

TEST_CASE("Sound is copied byte by byte under a film, whose pictures stay") {
    const ScratchFolder folder;
    constexpr int sounds = 36, frames = 18;
    write_file(folder / "sound.mp3", mp3_frames(sounds));
    write_grey(folder / "a.mp4", frames);
    write_grey(folder / "b.mp4", frames);
    CHECK(add_sound(folder / "sound.mp3", folder / "a.mp4") == FilmSound::kept);
    CHECK(add_sound(folder / "a.mp4", folder / "b.mp4") == FilmSound::kept);
    for (const char* name : {"a.mp4", "b.mp4"}) {
        const std::string bytes = read_file(folder / name);
        std::size_t at = 0;
        for (int i = 0; i < sounds; ++i) {
            at = bytes.find(mp3_frame(i), at);
            REQUIRE(at != std::string::npos);
        }
        FilmReader reader(folder / name);
        CHECK(reader.frames_per_second() == Approx(20.0));
        for (int i = 0; i < frames; ++i) {
            const std::optional<Tensor> frame = reader.next();
            REQUIRE(frame);
            CHECK(frame->values<float>()[300] == Approx(0.1 + 0.05 * i).margin(0.02));
        }
        CHECK_FALSE(reader.next());
    }
}

TEST_CASE("Without sound that an MP4 file can have a film stays as it is") {
    const ScratchFolder folder;
    write_grey(folder / "a.mp4", 3);
    const std::string bytes = read_file(folder / "a.mp4");
    // One channel of 16 bits, 8,000 numbers a second.
    write_file(folder / "a.wav",
               std::string("RIFF\xa4\x3e\0\0WAVEfmt \x10\0\0\0\1\0\1\0\x40\x1f\0\0\x80\x3e\0\0"
                           "\2\0\x10\0data\x80\x3e\0\0",
                           44) +
                   std::string(16000, '\0'));
    write_file(folder / "text.mp4", "no film");
    CHECK(add_sound(folder / "a.mp4", folder / "a.mp4") == FilmSound::none);
    CHECK(add_sound(folder / "a.wav", folder / "a.mp4") == FilmSound::other);
    CHECK_THROWS_WITH(add_sound(folder / "text.mp4", folder / "a.mp4"),
                      Contains("text.mp4: its sound cannot be copied"));
    CHECK(read_file(folder / "a.mp4") == bytes);
}

}  // namespace film_tests
