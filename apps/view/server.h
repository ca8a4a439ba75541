#pragma once

#include <cstddef>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "apps/view/access.h"
#include "apps/view/api.h"

namespace stymo::view {

struct ServerOptions {
    std::string host = "127.0.0.1";
    int port = 8080;  ///< 0: any free port
    /// Token that every request under /api must have; empty: none, or a random one where others
    /// can reach the server (Access).
    std::string token{};
    std::vector<std::string> origins{};  ///< addresses of the page behind proxies
    bool trusts_proxy = false;           ///< believes X-Forwarded-Host and X-Forwarded-Proto
    std::size_t most_body_bytes = 64U << 20U;
    ClientLimits clients{};
};

/// Serves the page and its requests over HTTP, to those whom Access lets in. It serves no files of
/// the machine. Clients that send or read slowly do not keep others out (ClientLimits): a
/// request that takes too long ends with its connection.
class Server {
public:
    /// `answer` is called by several threads at once and throws nothing (Api). Throws what
    /// `page_address` throws.
    Server(std::function<Answer(const Request&)> answer, const ServerOptions& options);
    ~Server();
    Server(const Server&) = delete;
    Server& operator=(const Server&) = delete;

    /// Serves requests until `stop`. Throws Error if the port is taken or the host is not an
    /// address of this machine.
    void start();
    void stop();
    /// The address of the page, behind the first proxy if there is one, with the token.
    [[nodiscard]] std::string address() const;
    [[nodiscard]] int port() const;

private:
    struct Implementation;
    std::unique_ptr<Implementation> implementation_;
};

}  // namespace stymo::view
