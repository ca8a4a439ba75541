#pragma once

#include <cstddef>
#include <memory>
#include <string>

#include "apps/view/api.h"

namespace stymo::view {

struct ServerOptions {
    std::string host = "127.0.0.1";
    int port = 8080;      ///< 0: any that is free
    std::string token{};  ///< that every request under /api must bring; empty: none
    std::size_t most_body_bytes = 32U << 20U;
    int threads = 128;           ///< connections that are served at once; further ones wait
    double read_seconds = 10.0;  ///< that a client may let pass before its next byte
};

/// Serves the page and its requests by HTTP. Requests whose Host is not this server, or whose
/// Origin is another page, are refused, so that no page of the web can reach it. No file of the
/// machine is served.
class Server {
public:
    Server(Api& api, const ServerOptions& options);
    ~Server();
    Server(const Server&) = delete;
    Server& operator=(const Server&) = delete;

    /// Throws Error if the port is taken or the host is not this machine's. Requests are served
    /// from then on until `stop`.
    void start();
    void stop();
    /// The address of the page, with the token.
    [[nodiscard]] std::string address() const;
    [[nodiscard]] int port() const;

private:
    struct Implementation;
    std::unique_ptr<Implementation> implementation_;
};

}  // namespace stymo::view
