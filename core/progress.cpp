#include "core/progress.h"

#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <iomanip>
#include <iostream>
#include <limits>
#include <sstream>

#include "core/clock.h"

namespace stymo {
namespace {

constexpr int bar_width = 24;
constexpr double terminal_interval = 0.1;
constexpr double plain_interval = 5.0;

int terminal_width() {
    winsize size{};
    return ioctl(STDERR_FILENO, TIOCGWINSZ, &size) == 0 && size.ws_col > 0 ? size.ws_col : 80;
}

std::string bar(double fraction) {
    const auto filled = static_cast<std::size_t>(fraction * bar_width);
    return "[" + std::string(filled, '#') + std::string(bar_width - filled, '.') + "] ";
}

}  // namespace

ProgressOutput::ProgressOutput()
    : stream(&std::cerr),
      terminal(isatty(STDERR_FILENO) != 0),
      width(terminal ? terminal_width() : std::numeric_limits<int>::max()),
      interval(terminal ? terminal_interval : plain_interval),
      seconds(seconds_now) {}

std::string duration_text(double seconds) {
    const auto whole = static_cast<std::int64_t>(std::ceil(std::max(seconds, 0.0)));
    std::ostringstream text;
    text << std::setfill('0');
    if (whole >= 3600) text << whole / 3600 << ":";
    text << std::setw(2) << whole / 60 % 60 << ":" << std::setw(2) << whole % 60;
    return text.str();
}

Progress::Progress(ProgressTask task, ProgressOutput output)
    : task_(std::move(task)),
      output_(std::move(output)),
      start_(output_.seconds()),
      last_shown_(-std::numeric_limits<double>::infinity()),
      done_(task_.first) {}

Progress::~Progress() {
    if (open_ && output_.terminal && std::isfinite(last_shown_)) *output_.stream << std::endl;
}

void Progress::update(std::int64_t done, std::string_view text) {
    done_ = done;
    if (open_ && output_.seconds() - last_shown_ >= output_.interval) show(text);
}

void Progress::message(std::string_view line) {
    *output_.stream << (output_.terminal ? "\r\x1b[K" : "") << line << std::endl;
    // The line replaced the bar; the next update draws the bar again.
    if (output_.terminal) last_shown_ = -std::numeric_limits<double>::infinity();
}

void Progress::finish(std::string_view text) {
    if (!open_) return;
    // A bar on a terminal is overwritten, but a plain line would appear twice.
    const bool said = shown_done_ == done_ && (text.empty() || text == shown_text_);
    if (output_.terminal || !said) show(text);
    if (output_.terminal) *output_.stream << std::endl;
    open_ = false;
}

std::string Progress::line(std::string_view text) const {
    const double elapsed = output_.seconds() - start_;
    const double rate = elapsed > 0.0 ? static_cast<double>(done_ - task_.first) / elapsed : 0.0;
    double fraction = 0.0;
    double left = std::numeric_limits<double>::infinity();
    if (task_.total > 0) {
        fraction = static_cast<double>(done_) / static_cast<double>(task_.total);
        if (rate > 0.0) left = static_cast<double>(task_.total - done_) / rate;
    }
    if (task_.time_limit > 0.0) {
        fraction = std::max(fraction, elapsed / task_.time_limit);
        left = std::min(left, task_.time_limit - elapsed);
    }
    fraction = std::clamp(fraction, 0.0, 1.0);

    std::ostringstream result;
    result << task_.title << " ";
    if (task_.total > 0 || task_.time_limit > 0.0) {
        if (output_.terminal) result << bar(fraction);
        result << std::setw(3) << static_cast<int>(100.0 * fraction) << "% ";
    }
    result << done_;
    if (task_.total > 0) result << "/" << task_.total;
    if (!task_.unit.empty())
        result << " " << std::fixed << std::setprecision(rate < 100.0 ? 1 : 0) << rate << " "
               << task_.unit << "/s";
    if (std::isfinite(left)) result << " " << duration_text(left) << " left";
    if (!text.empty()) result << "  " << text;
    return result.str();
}

void Progress::show(std::string_view text) {
    // One column stays free, because some terminals wrap a full line and would then keep copies of
    // the bar.
    const std::string shown =
        line(text).substr(0, static_cast<std::size_t>(std::max(output_.width - 1, 0)));
    *output_.stream << (output_.terminal ? "\r\x1b[K" : "") << shown;
    if (output_.terminal) {
        output_.stream->flush();
    } else {
        *output_.stream << std::endl;
    }
    last_shown_ = output_.seconds();
    shown_done_ = done_;
    shown_text_ = text;
}

}  // namespace stymo
