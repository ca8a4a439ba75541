#pragma once

#include <cstddef>
#include <functional>
#include <memory>
#include <string>

#include "apps/view/api.h"
#include "apps/view/client_limits.h"

namespace stymo::view {

struct ServerOptions {
    std::string host = "127.0.0.1";
    int port = 8080;      ///< 0: any free port
    std::string token{};  ///< token that every request under /api must have; empty: none
    std::size_t most_body_bytes = 32U << 20U;
    ClientLimits clients{};
};

/// Serves the page and its requests over HTTP. Requests whose Host is not this server, or whose
/// Origin is another page, are rejected, so that no other web page can use it. It serves no files
/// of the machine. Clients that send or read slowly do not keep others out (ClientLimits): a
/// request that takes too long ends with its connection.
class Server {
public:
    /// `answer` is called by several threads at once and throws nothing (Api).
    Server(std::function<Answer(const Request&)> answer, const ServerOptions& options);
    ~Server();
    Server(const Server&) = delete;
    Server& operator=(const Server&) = delete;

    /// Serves requests until `stop`. Throws Error if the port is taken or the host is not an
    /// address of this machine.
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
