#include "apps/view/timed_server.h"

#include <arpa/inet.h>
#include <netdb.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cerrno>
#include <string>

namespace stymo::view {

namespace {

using Clock = std::chrono::steady_clock;
using Seconds = std::chrono::duration<double>;
using std::chrono_literals::operator""ms;

constexpr double least_bytes_per_second = 64.0 * 1024.0;
constexpr std::size_t most_head_bytes = std::size_t{64} << 10U;
/// A client that has just connected is not put out.
constexpr auto patience = 500ms;

Clock::time_point after(double seconds) {
    return Clock::now() + std::chrono::duration_cast<Clock::duration>(Seconds(seconds));
}

using AddressOf = int (*)(int, sockaddr*, socklen_t*);

void read_address(AddressOf address_of, socket_t socket, std::string& ip, int& port) {
    sockaddr_storage storage{};
    socklen_t length = sizeof storage;
    auto* address = reinterpret_cast<sockaddr*>(&storage);
    std::array<char, NI_MAXHOST> host{};
    std::array<char, NI_MAXSERV> service{};
    if (address_of(socket, address, &length) != 0 ||
        getnameinfo(address, length, host.data(), host.size(), service.data(), service.size(),
                    NI_NUMERICHOST | NI_NUMERICSERV) != 0)
        return;
    ip = host.data();
    port = static_cast<int>(std::strtol(service.data(), nullptr, 10));
}

/// The bytes of a connection, with a deadline for each part of a request. Its functions have the
/// names that httplib calls; some of them exist only in older or newer versions.
// NOLINTBEGIN(modernize-use-override)
class Connection : public httplib::Stream {
public:
    /// Nothing more is read once `stops` is set.
    Connection(socket_t socket, const ClientLimits& limits, const std::atomic<bool>& stops)
        : socket_(socket), limits_(limits), stops_(stops) {}

    /// Whether the first byte of the next request comes in time.
    [[nodiscard]] bool awaits_request(time_t seconds) {
        in_head_ = true;
        writes_ = false;
        head_bytes_ = 0;
        const bool comes =
            begin_ < end_ || waits_until(POLLIN, after(static_cast<double>(seconds)));
        deadline_ = after(limits_.head_seconds);
        return comes;
    }
    void end_head() {
        in_head_ = false;
        deadline_ = after(limits_.body_seconds);
    }

    [[nodiscard]] bool is_readable() const { return wait_readable(); }
    [[nodiscard]] bool is_writable() const { return wait_writable(); }
    [[nodiscard]] bool wait_readable() const { return begin_ < end_ || waits_for(POLLIN); }
    [[nodiscard]] bool wait_writable() const { return waits_for(POLLOUT); }
    [[nodiscard]] time_t duration() const { return 0; }
    [[nodiscard]] socket_t socket() const { return socket_; }
    void get_remote_ip_and_port(std::string& ip, int& port) const {
        read_address(::getpeername, socket_, ip, port);
    }
    void get_local_ip_and_port(std::string& ip, int& port) const {
        read_address(::getsockname, socket_, ip, port);
    }

    ssize_t read(char* to, std::size_t size) {
        if (begin_ == end_) {
            change_direction(false);
            if (!waits_for(POLLIN)) return -1;
            const ssize_t got = ::recv(socket_, buffer_.data(), buffer_.size(), 0);
            if (got <= 0) return got;
            begin_ = 0;
            end_ = static_cast<std::size_t>(got);
            if (!counts(end_)) return -1;
        }
        const std::size_t count = std::min(size, end_ - begin_);
        std::copy_n(buffer_.data() + begin_, count, to);
        begin_ += count;
        return static_cast<ssize_t>(count);
    }

    ssize_t write(const char* from, std::size_t size) {
        change_direction(true);
        while (waits_for(POLLOUT)) {
            const ssize_t sent = ::send(socket_, from, size, MSG_NOSIGNAL | MSG_DONTWAIT);
            if (sent < 0 && (errno == EAGAIN || errno == EINTR)) continue;
            if (sent > 0) static_cast<void>(counts(static_cast<std::size_t>(sent)));
            return sent;
        }
        return -1;
    }

private:
    /// The time in which an answer is computed is not the client's.
    void change_direction(bool writes) {
        if (!in_head_ && writes_ != writes) deadline_ = after(limits_.body_seconds);
        writes_ = writes;
    }
    /// Counts bytes that were sent or have come; false for too large a head.
    bool counts(std::size_t bytes) {
        if (in_head_) return (head_bytes_ += bytes) <= most_head_bytes;
        deadline_ += std::chrono::duration_cast<Clock::duration>(
            Seconds(static_cast<double>(bytes) / least_bytes_per_second));
        return true;
    }
    [[nodiscard]] bool waits_for(short event) const {
        return waits_until(event, std::min(deadline_, after(limits_.read_seconds)));
    }
    [[nodiscard]] bool waits_until(short event, Clock::time_point until) const {
        constexpr long most_wait = 100;  // in milliseconds, until `stops_` is looked at again
        for (;;) {
            const auto left =
                std::chrono::ceil<std::chrono::milliseconds>(until - Clock::now()).count();
            if (event == POLLIN && stops_) return false;
            pollfd polled{.fd = socket_, .events = event, .revents = 0};
            const int ready =
                ::poll(&polled, 1, static_cast<int>(std::clamp<long>(left, 0, most_wait)));
            // Also for a connection that has been closed, as the call that follows finds.
            if (ready > 0) return left > 0;
            if ((ready == 0 && left <= most_wait) || (ready < 0 && errno != EINTR)) return false;
        }
    }

    socket_t socket_;
    const ClientLimits& limits_;
    const std::atomic<bool>& stops_;
    std::array<char, 4096> buffer_{};
    std::size_t begin_ = 0, end_ = 0;  ///< of what was read and not yet taken
    std::size_t head_bytes_ = 0;
    bool in_head_ = true, writes_ = false;
    Clock::time_point deadline_;
};
// NOLINTEND(modernize-use-override)

}  // namespace

bool has_no_body(const httplib::Request& request) {
    return request.method == "GET" || request.method == "HEAD";
}

bool has_unread_body(const httplib::Request& request) {
    return has_no_body(request) && (request.has_header("Transfer-Encoding") ||
                                    request.get_header_value_count("Content-Length") > 1 ||
                                    (request.has_header("Content-Length") &&
                                     request.get_header_value("Content-Length") != "0"));
}

TimedServer::TimedServer(const ClientLimits& limits) : limits_(limits) {
    // The additional thread lets a further connection in while all of them are taken.
    new_task_queue = [count = limits.connections + 1] {
        return new httplib::ThreadPool(count);  // httplib deletes it
    };
}

void TimedServer::stop_serving() {
    stops_ = true;
    stop();
    const std::lock_guard lock(mutex_);
    for (const auto& [socket, since] : heads_) ::shutdown(socket, SHUT_RDWR);
}

bool TimedServer::process_and_close_socket(socket_t socket) {
    enter();
    serve(socket);
    ::shutdown(socket, SHUT_RDWR);
    ::close(socket);
    leave();
    return true;
}

void TimedServer::serve(socket_t socket) {
    Connection connection(socket, limits_, stops_);
    bool ends = false;
    const std::function<void(httplib::Request&)> has_head = [&](const httplib::Request& request) {
        ends = has_unread_body(request);
        end_head(socket);
        connection.end_head();
    };
    // Newer versions of httplib also take both addresses.
    const auto answers = [&](auto& stream, bool& closes) {
        if constexpr (requires { process_request(stream, false, closes, has_head); }) {
            return process_request(stream, false, closes, has_head);
        } else {
            std::string remote, local;
            int remote_port = 0, local_port = 0;
            stream.get_remote_ip_and_port(remote, remote_port);
            stream.get_local_ip_and_port(local, local_port);
            return process_request(stream, remote, remote_port, local, local_port, false, closes,
                                   has_head);
        }
    };
    for (bool goes_on = true; goes_on;) {
        begin_head(socket);
        bool closes = false;
        goes_on = svr_sock_ != INVALID_SOCKET &&
                  connection.awaits_request(keep_alive_timeout_sec_) &&
                  answers(connection, closes) && !closes && !ends;
        end_head(socket);
    }
}

void TimedServer::enter() {
    std::unique_lock lock(mutex_);
    while (open_ >= limits_.connections) {
        const auto slowest =
            std::ranges::min_element(heads_, {}, [](const auto& head) { return head.second; });
        if (slowest != heads_.end() && Clock::now() - slowest->second > patience) {
            ::shutdown(slowest->first, SHUT_RDWR);
            heads_.erase(slowest);
        }
        left_.wait_for(lock, 50ms, [this] { return open_ < limits_.connections; });
    }
    // Those that wait do not count: enough of them would keep each other out.
    ++open_;
}

void TimedServer::leave() {
    {
        const std::lock_guard lock(mutex_);
        --open_;
    }
    left_.notify_one();
}

void TimedServer::begin_head(socket_t socket) {
    const std::lock_guard lock(mutex_);
    heads_[socket] = Clock::now();
}

void TimedServer::end_head(socket_t socket) {
    const std::lock_guard lock(mutex_);
    heads_.erase(socket);
}

}  // namespace stymo::view
