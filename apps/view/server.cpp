#include "apps/view/server.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <thread>

#include "apps/common/process_setup.h"
#include "apps/view/page_files.h"
#include "apps/view/random_token.h"
#include "apps/view/timed_server.h"
#include "core/error.h"
#include "core/io/json_writer.h"

namespace stymo::view {

namespace {

constexpr const char* session_header = "X-Stymo-Session";
constexpr const char* token_header = "X-Stymo-Token";

bool is_loopback(const std::string& host) {
    return host == "127.0.0.1" || host == "localhost" || host == "::1";
}

std::string type_of(std::string_view name) {
    if (name.ends_with(".html")) return "text/html; charset=utf-8";
    if (name.ends_with(".css")) return "text/css; charset=utf-8";
    if (name.ends_with(".svg")) return "image/svg+xml";
    return "text/javascript; charset=utf-8";
}

/// Takes constant time for texts of the same length.
bool equal_tokens(const std::string& a, const std::string& b) {
    unsigned difference = a.size() == b.size() ? 0U : 1U;
    for (std::size_t i = 0; i < std::min(a.size(), b.size()); ++i)
        difference |= static_cast<unsigned>(a[i] ^ b[i]);
    return difference == 0;
}

/// Closes the connection after the answer, so that the rest of the request, such as its body, is
/// not read as the next request. httplib does so only for a content provider that fails.
void refuse(httplib::Response& response, int status, const std::string& message) {
    response.status = status;
    response.set_header("Connection", "close");
    const std::string text = JsonValue::object({{"error", message}}).text();
    response.set_content_provider(
        text.size(), "application/json",
        [text](std::size_t /*offset*/, std::size_t /*length*/, httplib::DataSink& sink) {
            sink.write(text.data(), text.size());
            return false;
        });
}

/// Whether the body has a Content-Length and no encoding. httplib reads chunked bodies, and
/// inflates compressed ones, without a limit.
bool announces_body(const httplib::Request& request) {
    return request.has_header("Content-Length") && !request.has_header("Transfer-Encoding") &&
           !request.has_header("Content-Encoding");
}

bool is_longer(const httplib::Request& request, std::size_t most_bytes) {
    const std::string text = request.get_header_value("Content-Length");
    std::size_t length = 0;
    const char* end = text.data() + text.size();
    const auto [last, error] = std::from_chars(text.data(), end, length);
    return error != std::errc() || last != end || length > most_bytes;
}

}  // namespace

struct Server::Implementation {
    std::function<Answer(const Request&)> answer_to;
    ServerOptions options;
    TimedServer http;
    std::thread listener;
    int port = 0;

    Implementation(std::function<Answer(const Request&)> answers, ServerOptions given)
        : answer_to(std::move(answers)), options(std::move(given)), http(options.clients) {}

    /// Rejects requests from other origins before their body is read.
    [[nodiscard]] httplib::Server::HandlerResponse guard(const httplib::Request& request,
                                                         httplib::Response& response) const;
    [[nodiscard]] bool is_own(const std::string& host) const;
    void answer(const httplib::Request& request, httplib::Response& response);
    static void page(const httplib::Request& request, httplib::Response& response);
    void set_up();
};

bool Server::Implementation::is_own(const std::string& host) const {
    const std::string end = ":" + std::to_string(port);
    // If the server is open to a network, its machine may have names that the server does not know.
    if (!is_loopback(options.host)) return true;
    return std::ranges::any_of(std::array{"127.0.0.1", "localhost", "[::1]"},
                               [&](const char* name) {
                                   // Browsers leave out the usual port.
                                   return host == name + end || (port == 80 && host == name);
                               });
}

httplib::Server::HandlerResponse Server::Implementation::guard(const httplib::Request& request,
                                                               httplib::Response& response) const {
    using enum httplib::Server::HandlerResponse;
    const std::string host = request.get_header_value("Host");
    if (!is_own(host)) {
        refuse(response, 403, "this name is not the viewer's");
        return Handled;
    }
    if (request.has_header("Origin") && request.get_header_value("Origin") != "http://" + host) {
        refuse(response, 403, "requests of other pages are not answered");
        return Handled;
    }
    if (request.path.starts_with("/api/") && !options.token.empty() &&
        !equal_tokens(request.get_header_value(token_header), options.token)) {
        refuse(response, 401, "the token is missing or wrong; open the address that was printed");
        return Handled;
    }
    // Several ranges could multiply the size of the answer.
    if (request.has_header("Range")) {
        refuse(response, 416, "parts of files are not served");
        return Handled;
    }
    if (request.method == "POST" && !announces_body(request)) {
        refuse(response, 411, "a request needs its length and must not be compressed");
        return Handled;
    }
    if (request.has_header("Content-Length") && is_longer(request, options.most_body_bytes)) {
        refuse(response, 413, "the request is too large");
        return Handled;
    }
    return Unhandled;
}

void Server::Implementation::answer(const httplib::Request& request, httplib::Response& response) {
    Request asked{.path = request.path,
                  .session = request.get_header_value(session_header),
                  .query = {},
                  .body = request.body};
    for (const auto& [name, value] : request.params) asked.query.emplace(name, value);
    const Answer answer = answer_to(asked);
    response.status = answer.status;
    for (const auto& [name, value] : answer.headers) response.set_header(name, value);
    response.set_content(answer.body, answer.type);
}

void Server::Implementation::page(const httplib::Request& request, httplib::Response& response) {
    const std::string name =
        request.path == "/" ? "index.html" : request.path.substr(std::string("/page/").size());
    const std::optional<PageFile> file = page_file(name);
    if (!file) {
        refuse(response, 404, "there is no such page");
        return;
    }
    response.set_header("Content-Security-Policy",
                        "default-src 'self'; img-src 'self' blob: data:; media-src blob:; "
                        "frame-ancestors 'none'");
    response.set_content(std::string(file->text), type_of(file->name));
}

void Server::Implementation::set_up() {
    http.set_keep_alive_max_count(1'000'000);
    http.set_keep_alive_timeout(5);
    http.set_payload_max_length(options.most_body_bytes);
    http.set_tcp_nodelay(true);
    // Without SO_REUSEPORT, so that a second server finds the port taken.
    http.set_socket_options([](socket_t socket) {
        const int yes = 1;
        setsockopt(socket, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof yes);
    });
    http.set_default_headers({{"X-Content-Type-Options", "nosniff"},
                              {"Cache-Control", "no-store"},
                              {"Referrer-Policy", "no-referrer"}});
    http.set_pre_routing_handler(
        [this](const httplib::Request& request, httplib::Response& response) {
            return guard(request, response);
        });
    http.set_error_handler([](const httplib::Request&, httplib::Response& response) {
        if (response.body.empty() && !response.has_header("Connection"))
            refuse(response, response.status, "the request is not understood");
    });
    const auto served = [this](const httplib::Request& request, httplib::Response& response) {
        answer(request, response);
    };
    http.Get("/", page);
    http.Get("/page/[a-z_]+\\.[a-z]+", page);
    http.Post("/api/[a-z]+", served);
}

Server::Server(std::function<Answer(const Request&)> answer, const ServerOptions& options)
    : implementation_(std::make_unique<Implementation>(std::move(answer), options)) {}

Server::~Server() {
    stop();
}

void Server::start() {
    Implementation& server = *implementation_;
    if (!is_loopback(server.options.host) && server.options.token.empty())
        server.options.token = random_token();
    server.set_up();
    server.port = server.options.port;
    if (server.port == 0) {
        server.port = server.http.bind_to_any_port(server.options.host);
        if (server.port < 0) fail<Error>(server.options.host, ": no port can be had");
    } else if (!server.http.bind_to_port(server.options.host, server.port)) {
        fail<Error>(server.options.host, ":", server.port,
                    ": cannot be opened; take another one with --port, or 0 for any that is free");
    }
    server.listener = std::thread([&server] { server.http.listen_after_bind(); });
    while (!server.http.is_running()) std::this_thread::yield();
}

void Server::stop() {
    Implementation& server = *implementation_;
    if (!server.listener.joinable()) return;
    server.http.stop_serving();
    server.listener.join();
}

std::string Server::address() const {
    const ServerOptions& options = implementation_->options;
    const bool six = options.host.find(':') != std::string::npos;
    const bool every = options.host == "0.0.0.0" || options.host == "::";
    const std::string host = every ? host_name() : six ? "[" + options.host + "]" : options.host;
    std::string address = "http://" + host + ":" + std::to_string(implementation_->port) + "/";
    if (!options.token.empty()) address += "?token=" + options.token;
    return address;
}

int Server::port() const {
    return implementation_->port;
}

}  // namespace stymo::view
