#pragma once

#include <httplib.h>

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <functional>
#include <map>
#include <mutex>

#include "apps/view/access.h"

namespace stymo::view {

/// Whether the method is one whose body httplib does not read.
[[nodiscard]] bool has_no_body(const httplib::Request& request);
/// Whether a request of such a method brings a body nevertheless. It would be taken for the next
/// request of its connection, which a proxy may share between clients.
[[nodiscard]] bool has_unread_body(const httplib::Request& request);

/// httplib's server limits the time between two bytes of a request only, so that clients that drip
/// hold its threads for ever. This one limits the time of whole requests, and closes a connection
/// after a request with an unread body. While all connections are
/// taken, a new one takes the place of the connection whose client has taken longest to send the
/// head of its next request; so clients that do not know the token cannot keep others out.
class TimedServer : public httplib::Server {
public:
    explicit TimedServer(const ClientLimits& limits);
    /// Stops listening. Clients that have not sent a complete request are not waited for.
    void stop_serving();

private:
    using Clock = std::chrono::steady_clock;

    bool process_and_close_socket(socket_t socket) override;
    void serve(socket_t socket);
    /// Waits until there is room for a further connection.
    void enter();
    void leave();
    void begin_head(socket_t socket);
    void end_head(socket_t socket);

    ClientLimits limits_;
    std::atomic<bool> stops_ = false;
    std::mutex mutex_;
    std::condition_variable left_;
    std::size_t open_ = 0;
    std::map<socket_t, Clock::time_point> heads_;  ///< since when a request is awaited
};

}  // namespace stymo::view
