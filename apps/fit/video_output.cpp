#include "apps/fit/video_output.h"

#include <fstream>

#include "apps/common/video_options.h"
#include "core/angle.h"
#include "core/error.h"
#include "core/interrupt.h"
#include "core/io/file.h"
#include "nn/models/code_file.h"

namespace stymo {

AppResult fit_video(const Fitting& fitting, const std::filesystem::path& film,
                    const std::filesystem::path& out, VideoFitOptions options) {
    const InterruptGuard guard;
    options.on_progress = video_progress();
    const VideoFit video(fitting.job, film, options);
    require_writable_folder(out);
    VideoSummary summary;
    const std::filesystem::path file = out / "codes.jsonl";
    write_whole(file, [&](const std::filesystem::path& temporary) {
        std::ofstream stream(temporary, std::ios::binary);
        summary = video.run([&](const FittedFrame& frame) {
            JsonValue line = code_file_json(frame.codes, 0, frame.pose, fitting.mark);
            line.add("frame", frame.index).add("face", frame.found).add("starts", frame.starts);
            stream << line.add("roll_deg", degrees_from_radians(frame.roll)).text() << '\n';
        });
        if (interrupted()) fail("interrupted; nothing was written");
        stream.flush();
        if (!stream) fail<FileError>(file.string(), ": cannot be written; is the disk full?");
    });
    AppResult result{text_of(summary), to_json(summary)};
    result.json.add("frames_per_second", video.frames_per_second());
    write_file(out / "report.json", result.json.text() + "\n", Durability::none);
    return result;
}

}  // namespace stymo
