#pragma once

#include <cstdint>
#include <functional>
#include <iosfwd>
#include <string>
#include <string_view>

namespace stymo {

/// Where and how often progress is shown. By default on stderr: a bar if it is a terminal, else a
/// line every few seconds.
struct ProgressOutput {
    ProgressOutput();

    std::ostream* stream;             ///< never null
    bool terminal;                    ///< redraw one line in place
    int width;                        ///< columns of the terminal
    double interval;                  ///< seconds between two updates
    std::function<double()> seconds;  ///< a clock that never goes back
};

/// The task whose progress is shown.
struct ProgressTask {
    std::string title;
    std::int64_t total = 0;  ///< 0: not known
    std::int64_t first = 0;  ///< done before this run began; not part of the rate
    std::string unit = {};   ///< "images" gives "12.3 images/s"; empty: no rate
    /// Seconds after which the work stops even if `total` is not reached; 0: no limit.
    double time_limit = 0.0;
};

/// Shows the progress of a loop, its rate and the remaining time. For use by one thread.
class Progress {
public:
    explicit Progress(ProgressTask task, ProgressOutput output = {});
    /// Ends the line of the bar.
    ~Progress();
    Progress(const Progress&) = delete;
    Progress& operator=(const Progress&) = delete;

    /// `done` counts from 0 to the total. Cheap enough to call at each step, because it writes only
    /// when the interval has passed.
    void update(std::int64_t done, std::string_view text = {});
    /// Writes a separate line above the bar (a warning, a skipped file).
    void message(std::string_view line);
    /// Shows the final state at once, unless it is already shown. Further calls do nothing.
    void finish(std::string_view text = {});

private:
    [[nodiscard]] std::string line(std::string_view text) const;
    void show(std::string_view text);

    ProgressTask task_;
    ProgressOutput output_;
    double start_;
    double last_shown_;
    std::int64_t done_;
    std::int64_t shown_done_ = -1;
    std::string shown_text_;
    bool open_ = true;
};

/// "00:07", "12:34", "1:02:03"
[[nodiscard]] std::string duration_text(double seconds);

}  // namespace stymo
