#include "apps/view/server.h"

#include <algorithm>
#include <charconv>
#include <regex>
#include <thread>

#include "apps/common/process_setup.h"
#include "apps/view/access.h"
#include "apps/view/page_files.h"
#include "apps/view/timed_server.h"
#include "core/error.h"
#include "core/io/json_writer.h"

namespace stymo::view {

namespace {

constexpr const char* session_header = "X-Stymo-Session";
constexpr const char* token_header = "X-Stymo-Token";

Access access_of(const ServerOptions& options) {
    std::vector<PageAddress> addresses;
    for (const std::string& url : options.origins) addresses.push_back(page_address(url));
    return {options.host, options.token, std::move(addresses), options.trusts_proxy};
}

Asker asker_of(const httplib::Request& request) {
    Asker asker{.host = request.get_header_value("Host"),
                .site = request.get_header_value("Sec-Fetch-Site"),
                .forwarded_host = request.get_header_value("X-Forwarded-Host"),
                .forwarded_proto = request.get_header_value("X-Forwarded-Proto"),
                .token = request.get_header_value(token_header),
                .reads_page = request.method == "GET" || request.method == "HEAD"};
    if (request.has_header("Origin")) asker.origin = request.get_header_value("Origin");
    return asker;
}

std::string type_of(std::string_view name) {
    if (name.ends_with(".html")) return "text/html; charset=utf-8";
    if (name.ends_with(".css")) return "text/css; charset=utf-8";
    if (name.ends_with(".svg")) return "image/svg+xml";
    return "text/javascript; charset=utf-8";
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
    Access access;
    TimedServer http;
    std::thread listener;
    int port = 0;

    Implementation(std::function<Answer(const Request&)> answers, ServerOptions given)
        : answer_to(std::move(answers)),
          options(std::move(given)),
          access(access_of(options)),
          http(options.clients) {}

    /// Rejects requests from other origins before their body is read.
    [[nodiscard]] httplib::Server::HandlerResponse guard(const httplib::Request& request,
                                                         httplib::Response& response) const;
    void answer(const httplib::Request& request, httplib::Response& response);
    /// A file of the page.
    void page(const std::string& name, const httplib::Request& request,
              httplib::Response& response) const;
    void set_up();
    /// Routes for the page and its requests below this path, which may be "/".
    void serve_below(const std::string& path);
};

httplib::Server::HandlerResponse Server::Implementation::guard(const httplib::Request& request,
                                                               httplib::Response& response) const {
    using enum httplib::Server::HandlerResponse;
    if (const std::optional<Refusal> refusal = access.refusal(asker_of(request))) {
        refuse(response, refusal->status, refusal->reason);
        return Handled;
    }
    // Several ranges could multiply the size of the answer.
    if (request.has_header("Range")) {
        refuse(response, 416, "parts of files are not served");
        return Handled;
    }
    // httplib reads the bodies of other methods, too, before it looks for who serves them.
    if (has_unread_body(request)) {
        refuse(response, 400, "a request of this kind has no body");
        return Handled;
    }
    if (!has_no_body(request) && !announces_body(request)) {
        refuse(response, 411, "a request needs its length and must not be compressed");
        return Handled;
    }
    if (request.has_header("Content-Length") && is_longer(request, options.most_body_bytes)) {
        refuse(response, 413,
               "the request is too large; --max-pixels of stymo-view raises the limit");
        return Handled;
    }
    return Unhandled;
}

void Server::Implementation::answer(const httplib::Request& request, httplib::Response& response) {
    Request asked{.path = request.matches[1],
                  .session = request.get_header_value(session_header),
                  .query = {},
                  .body = request.body};
    for (const auto& [name, value] : request.params) asked.query.emplace(name, value);
    const Answer answer = answer_to(asked);
    response.status = answer.status;
    for (const auto& [name, value] : answer.headers) response.set_header(name, value);
    response.set_content(answer.body, answer.type);
}

void Server::Implementation::page(const std::string& name, const httplib::Request& request,
                                  httplib::Response& response) const {
    const std::optional<PageFile> file = page_file(name);
    if (!file) {
        refuse(response, 404, "there is no such page");
        return;
    }
    response.set_header("Content-Security-Policy",
                        "default-src 'self'; img-src 'self' blob: data:; media-src blob:; "
                        "frame-ancestors 'none'");
    std::string text(file->text);
    const std::set<std::string> paths = access.paths_on(request.get_header_value("Host"));
    // A proxy that takes the path away does not tell whether the browser's ends with a slash, and
    // of several paths not which.
    if (name == "index.html" && paths.size() == 1) {
        const std::string head = "<head>";
        text.insert(text.find(head) + head.size(), "<base href=\"" + *paths.begin() + "\">");
    }
    response.set_content(text, type_of(file->name));
}

void Server::Implementation::serve_below(const std::string& path) {
    const std::string start = std::regex_replace(path, std::regex("\\."), "\\.");
    http.Get(start, [this](const auto& request, auto& response) {
        page("index.html", request, response);
    });
    http.Get(start + "page/([a-z_]+\\.[a-z]+)", [this](const auto& request, auto& response) {
        page(request.matches[1], request, response);
    });
    http.Post(start.substr(0, start.size() - 1) + "(/api/[a-z]+)",
              [this](const auto& request, auto& response) { answer(request, response); });
    if (path == "/") return;
    http.Get(start.substr(0, start.size() - 1), [](const auto& request, auto& response) {
        const std::string& target = request.target;
        const std::size_t query = std::min(target.find('?'), target.size());
        const std::size_t last = target.rfind('/', query) + 1;
        constexpr int moved = 308;
        response.set_redirect(target.substr(last, query - last) + "/" + target.substr(query),
                              moved);
    });
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
    serve_below("/");
    // Some proxies pass the whole path on.
    for (const PageAddress& address : access.addresses())
        if (address.path != "/") serve_below(address.path);
}

Server::Server(std::function<Answer(const Request&)> answer, const ServerOptions& options)
    : implementation_(std::make_unique<Implementation>(std::move(answer), options)) {}

Server::~Server() {
    stop();
}

void Server::start() {
    Implementation& server = *implementation_;
    server.set_up();
    server.port = server.options.port;
    if (server.port == 0) {
        server.port = server.http.bind_to_any_port(server.options.host);
        if (server.port < 0)
            fail<Error>(server.options.host,
                        ": no port can be had; is this --host an address of this machine?");
    } else if (!server.http.bind_to_port(server.options.host, server.port)) {
        fail<Error>(server.options.host, ":", server.port,
                    ": cannot be opened; take another one with --port, or 0 for any that is free, "
                    "and an address of this machine as --host");
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
    const std::string& named = implementation_->options.host;
    const bool six = named.find(':') != std::string::npos;
    const bool every = named == "0.0.0.0" || named == "::";
    const std::string host = every ? host_name() : six ? "[" + named + "]" : named;
    std::string address = "http://" + host + ":" + std::to_string(implementation_->port) + "/";
    const Access& access = implementation_->access;
    if (!access.addresses().empty())
        address = access.addresses().front().origin + access.addresses().front().path;
    if (!access.token().empty()) address += "?token=" + access.token();
    return address;
}

int Server::port() const {
    return implementation_->port;
}

}  // namespace stymo::view
