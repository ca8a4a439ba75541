#include <catch2/catch.hpp>
#include <opencv2/core.hpp>
#include <opencv2/videoio.hpp>

#include "core/error.h"
#include "core/io/file.h"
#include "core/io/film.h"
#include "core/io/scratch_folder.h"

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

}  // namespace

TEST_CASE("A film has the frames that were written, one after the other") {
    const ScratchFolder folder;
    FilmWriter writer(folder / "a.mp4", folder / "a.mp4", 36, 50, 20.0);
    for (int i = 0; i < 9; ++i) writer.add(grey_frame(i));
    writer.finish();
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
}

}  // namespace film_tests
