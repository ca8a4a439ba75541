#include "fuzz/http_client.h"

#include <arpa/inet.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cstdlib>
#include <string_view>

#include "apps/view/server.h"
#include "core/error.h"
#include "fuzz/request_readers.h"

namespace stymo::fuzz {

namespace {

view::Answer answer(const view::Request& request) {
    try {
        read_request_body(request.body);
        return {.body = std::to_string(request.number("x", 0.0, 0.0, 1.0))};
    } catch (const Error& error) {
        return {.status = 400, .body = error.what()};
    }
}

class RunningServer {
public:
    RunningServer()
        : server_(answer, {.port = 0, .most_body_bytes = 4096, .clients = {.connections = 1}}) {
        server_.start();
        address_.sin_family = AF_INET;
        address_.sin_port = htons(static_cast<std::uint16_t>(server_.port()));
        address_.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    }

    [[nodiscard]] std::string host() const { return "127.0.0.1:" + std::to_string(server_.port()); }
    [[nodiscard]] std::string exchange(const std::string& bytes) const {
        const int socket = ::socket(AF_INET, SOCK_STREAM, 0);
        if (::connect(socket, reinterpret_cast<const sockaddr*>(&address_), sizeof address_) != 0)
            std::abort();
        static_cast<void>(::send(socket, bytes.data(), bytes.size(), MSG_NOSIGNAL));
        ::shutdown(socket, SHUT_WR);
        std::string all;
        char part[4096];
        for (ssize_t size = 0; (size = ::recv(socket, part, sizeof part, 0)) > 0;)
            all.append(part, static_cast<std::size_t>(size));
        ::close(socket);
        return all;
    }

private:
    view::Server server_;
    sockaddr_in address_{};
};

}  // namespace

void send_to_server(std::string bytes) {
    static const RunningServer server;
    constexpr std::string_view name = "$HOST";
    for (std::size_t at = 0; (at = bytes.find(name, at)) != std::string::npos;)
        bytes.replace(at, name.size(), server.host());
    const std::string answered = server.exchange(bytes);
    if (!answered.empty() && !answered.starts_with("HTTP/1.")) std::abort();
}

}  // namespace stymo::fuzz
