// The HTTP of stymo-view: who is answered and who is not.
#include <arpa/inet.h>
#include <sys/socket.h>
#include <unistd.h>

#include <atomic>
#include <catch2/catch.hpp>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <functional>
#include <thread>

#include "apps/tiny_run.h"
#include "apps/tool_run.h"
#include "apps/view/page_files.h"
#include "apps/view/server.h"
#include "apps/view_client.h"
#include "core/clock.h"
#include "core/error.h"
#include "core/io/file.h"

using namespace stymo;

namespace {

using std::chrono_literals::operator""ms;

/// A connection to this machine that sends and reads bytes as they are.
class Connection {
public:
    explicit Connection(int port) : socket_(::socket(AF_INET, SOCK_STREAM, 0)) {
        sockaddr_in address{};
        address.sin_family = AF_INET;
        address.sin_port = htons(static_cast<std::uint16_t>(port));
        address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
        REQUIRE(::connect(socket_, reinterpret_cast<sockaddr*>(&address), sizeof address) == 0);
    }
    ~Connection() { ::close(socket_); }
    Connection(const Connection&) = delete;
    Connection& operator=(const Connection&) = delete;

    void send(const std::string& bytes) const {
        static_cast<void>(::send(socket_, bytes.data(), bytes.size(), MSG_NOSIGNAL));
    }
    /// Ends a `send` that waits in another thread.
    void shut_down() const { ::shutdown(socket_, SHUT_RDWR); }
    /// The next byte, if one comes within 10 s.
    [[nodiscard]] bool reads_a_byte() const {
        char byte = 0;
        return ::recv(socket_, &byte, 1, 0) == 1;
    }
    /// All that comes until the other side closes or 10 s pass.
    [[nodiscard]] std::string rest() const {
        const timeval limit{.tv_sec = 10, .tv_usec = 0};
        ::setsockopt(socket_, SOL_SOCKET, SO_RCVTIMEO, &limit, sizeof limit);
        std::string text;
        char buffer[4096];
        for (ssize_t size = 0; (size = ::recv(socket_, buffer, sizeof buffer, 0)) > 0;)
            text.append(buffer, static_cast<std::size_t>(size));
        return text;
    }

private:
    int socket_;
};

struct Running {
    ViewClient client;
    view::Server server;
    explicit Running(view::ServerOptions options = {})
        : server(std::ref(client.api()), with_port(options)) {
        server.start();
    }
    static view::ServerOptions with_port(view::ServerOptions options) {
        options.port = 0;
        options.clients.connections = 8;
        options.clients.read_seconds = 0.5;
        return options;
    }
    [[nodiscard]] std::string exchange(const std::string& request) const {
        const Connection connection(server.port());
        connection.send(request);
        return connection.rest();
    }
    [[nodiscard]] std::string host() const { return "127.0.0.1:" + std::to_string(server.port()); }
    /// A request whose headers end with "Connection: close" and the given ones.
    [[nodiscard]] std::string request(const std::string& line, const std::string& headers = {},
                                      const std::string& body = {}) const {
        return line + " HTTP/1.1\r\nHost: " + host() + "\r\nConnection: close\r\n" + headers +
               "Content-Length: " + std::to_string(body.size()) + "\r\n\r\n" + body;
    }
};

bool is_status(const std::string& answer, int status) {
    return answer.starts_with("HTTP/1.1 " + std::to_string(status));
}

}  // namespace

TEST_CASE("the page and its files are served, and no file of the machine", "[view]") {
    if (!view::page_file("index.html")) FAIL("the page is not part of the program");
    const Running running;
    CHECK(is_status(running.exchange(running.request("GET /")), 200));
    CHECK(is_status(running.exchange(running.request("GET /page/app.js")), 200));
    for (const char* path :
         {"/page/none.js", "/etc/passwd", "/page/../../etc/passwd", "/page/%2e%2e/server.cpp",
          "/page/..%2f..%2fetc%2fpasswd", "//etc/passwd", "/api/frame"}) {
        INFO(path);
        const std::string answer = running.exchange(running.request("GET " + std::string(path)));
        CHECK((is_status(answer, 404) || is_status(answer, 400)));
        CHECK(answer.find("root:") == std::string::npos);
    }
}

TEST_CASE("requests of other names and other pages are refused", "[view]") {
    const Running running;
    const std::string post = "POST /api/session";
    CHECK(is_status(running.exchange(running.request(post)), 200));
    CHECK(is_status(
        running.exchange(running.request(post, "Origin: http://" + running.host() + "\r\n")), 200));
    CHECK(
        is_status(running.exchange(running.request(post, "Origin: http://evil.example\r\n")), 403));
    CHECK(is_status(running.exchange(post + " HTTP/1.1\r\nHost: evil.example\r\n"
                                            "Connection: close\r\nContent-Length: 0\r\n\r\n"),
                    403));
}

TEST_CASE("a server that is open to others wants its token", "[view]") {
    const Running running({.host = "0.0.0.0"});
    const std::string address = running.server.address();
    const std::size_t at = address.find("?token=");
    REQUIRE(at != std::string::npos);
    const std::string token = address.substr(at + 7);
    CHECK(token.size() == 32);
    const auto post = [&](const std::string& header) {
        return running.exchange(running.request("POST /api/session", header));
    };
    CHECK(is_status(post(""), 401));
    CHECK(is_status(post("X-Stymo-Token: " + std::string(32, '0') + "\r\n"), 401));
    CHECK(is_status(post("X-Stymo-Token: " + token + "\r\n"), 200));
}

TEST_CASE("the page is served below the path of its proxy, too", "[view]") {
    view::ServerOptions options{.token = "secret"};
    options.origins = {"https://name.example/user/a.b/proxy/8080"};
    const Running running(options);
    CHECK(running.server.address() == "https://name.example/user/a.b/proxy/8080/?token=secret");
    const std::string path = "/user/a.b/proxy/8080";
    const auto get = [&](const std::string& at) {
        return running.exchange(running.request("GET " + at));
    };
    for (const std::string& start : {std::string(), path}) {
        INFO(start);
        CHECK(is_status(get(start + "/"), 200));
        CHECK(is_status(get(start + "/page/app.js"), 200));
        const std::string post = "POST " + start + "/api/session";
        CHECK(is_status(running.exchange(running.request(post)), 401));
        CHECK(is_status(running.exchange(running.request(post, "X-Stymo-Token: secret\r\n")), 200));
    }
    const std::string moved = get(path + "?token=secret");
    CHECK(is_status(moved, 308));
    CHECK_THAT(moved, Catch::Contains("Location: 8080/?token=secret\r\n"));
    for (const char* other :
         {"/user/axb/proxy/8080/", "/user/a.b/proxy/", "/proxy/8080/page/app.js"}) {
        INFO(other);
        CHECK(is_status(get(other), 404));
    }
    // A browser that reached the page without the last slash still finds its files.
    const std::string named =
        running.exchange("GET / HTTP/1.1\r\nHost: name.example\r\nConnection: close\r\n\r\n");
    CHECK_THAT(named, Catch::Contains("<base href=\"/user/a.b/proxy/8080/\">"));
    CHECK(get("/").find("<base") == std::string::npos);
    options.origins = {"name.example"};
    CHECK_THROWS_AS(Running(options), UsageError);
    // Of two paths of one name nothing says which one the browser sees; the same one twice does.
    options.origins = {"https://name.example" + path, "http://name.example" + path};
    const std::string from_name =
        "GET / HTTP/1.1\r\nHost: name.example\r\nConnection: close\r\n\r\n";
    CHECK_THAT(Running(options).exchange(from_name), Catch::Contains("<base href=\"" + path));
    options.origins = {"https://name.example", "https://name.example" + path};
    const Running two(options);
    CHECK(two.exchange(from_name).find("<base") == std::string::npos);
    for (const std::string& start : {std::string(), path})
        CHECK(is_status(two.exchange("GET " + start +
                                     "/page/app.js HTTP/1.1\r\nHost: name.example\r\n"
                                     "Connection: close\r\n\r\n"),
                        200));
}

TEST_CASE("a forwarded port is answered, a page that leads here is not", "[view]") {
    const Running running;
    const auto post = [&](const std::string& host, const std::string& headers) {
        return running.exchange("POST /api/session HTTP/1.1\r\nHost: " + host + "\r\n" + headers +
                                "Connection: close\r\nContent-Length: 0\r\n\r\n");
    };
    CHECK(is_status(post("localhost:9000", "Origin: http://localhost:9000\r\n"), 200));
    CHECK(is_status(post("localhost:9000", "Origin: http://localhost:9001\r\n"), 403));
    CHECK(is_status(post("localhost:9000", "Sec-Fetch-Site: cross-site\r\n"), 403));
    CHECK(is_status(post("rebind.example:" + std::to_string(running.server.port()), ""), 403));
}

TEST_CASE("malformed and huge requests are answered, and the server goes on", "[view]") {
    const Running running({.most_body_bytes = 1000});
    CHECK(is_status(running.exchange("nonsense\r\n\r\n"), 400));
    static_cast<void>(running.exchange(std::string(20000, 'x').append("\r\n\r\n")));
    static_cast<void>(running.exchange("POST /api/frame HTTP/1.1\r\nHost: " + running.host() +
                                       "\r\nContent-Length: -5\r\n\r\n"));
    const std::string large = "POST /api/photo HTTP/1.1\r\nHost: " + running.host() +
                              "\r\nConnection: close\r\nContent-Length: 99999999999\r\n\r\n";
    CHECK(is_status(running.exchange(large), 413));
    CHECK(is_status(running.exchange(running.request("GET /")), 200));
}

TEST_CASE("what is left of a refused request is not taken for the next one", "[view]") {
    const Running running({.most_body_bytes = 1000});
    const std::string hidden = running.request("POST /api/session");
    const std::string start = "POST /api/session HTTP/1.1\r\nHost: ";
    const std::string length = "\r\nContent-Length: " + std::to_string(hidden.size());
    const std::string chunk = "1000\r\n" + std::string(4096, 'x') + "\r\n";
    struct Row {
        const char* why;
        std::string request;
        int status;
    };
    const std::string own = start + running.host();
    const std::vector<Row> rows{
        {"another host", start + "evil.example" + length + "\r\n\r\n" + hidden, 403},
        {"another page", own + "\r\nOrigin: http://evil.example" + length + "\r\n\r\n" + hidden,
         403},
        {"in chunks", own + "\r\nTransfer-Encoding: chunked\r\n\r\n" + chunk, 411},
        {"in chunks by another method",
         "PUT /api/session HTTP/1.1\r\nHost: " + running.host() +
             "\r\nTransfer-Encoding: chunked\r\n\r\n" + chunk,
         411},
        {"without a length", own + "\r\n\r\n" + hidden, 411},
        {"compressed", own + length + "\r\nContent-Encoding: gzip\r\n\r\n" + hidden, 411},
        {"too long", own + "\r\nContent-Length: 1001\r\n\r\n" + hidden, 413},
        {"no length", own + "\r\nContent-Length: many\r\n\r\n" + hidden, 413},
        {"ranges", own + length + "\r\nRange: bytes=0-1,0-1\r\n\r\n" + hidden, 416},
        {"a page with a body",
         "GET / HTTP/1.1\r\nHost: " + running.host() + length + "\r\n\r\n" + hidden, 400},
        {"a page with two lengths",
         "GET / HTTP/1.1\r\nHost: " + running.host() + "\r\nContent-Length: 0" + length +
             "\r\n\r\n" + hidden,
         400},
        {"a page in chunks",
         "GET / HTTP/1.1\r\nHost: " + running.host() + "\r\nTransfer-Encoding: chunked\r\n\r\n" +
             chunk,
         400},
        {"no such page", "GET /page/none.js HTTP/1.1\r\nHost: " + running.host() + "\r\n\r\n", 404},
    };
    for (const Row& row : rows) {
        INFO(row.why);
        const std::string answer = running.exchange(row.request);
        INFO(answer);
        CHECK(is_status(answer, row.status));
        CHECK(answer.find("HTTP/1.1", 8) == std::string::npos);  // one answer
        CHECK(answer.find("{\"error\":") != std::string::npos);
    }
    CHECK(running.client.sessions() == 1);
}

TEST_CASE("clients that send nothing, or a byte now and then, do not keep others out", "[view]") {
    const Running running;  // eight connections at once
    std::vector<std::unique_ptr<Connection>> idle;
    for (int i = 0; i < 20; ++i) {
        idle.push_back(std::make_unique<Connection>(running.server.port()));
        idle.back()->send("POST /api/fr");
    }
    CHECK(is_status(running.exchange(running.request("GET /")), 200));
}

TEST_CASE("clients that drip requests do not keep others out", "[view]") {
    const Running running;  // eight connections at once
    std::vector<std::unique_ptr<Connection>> slow;
    for (int i = 0; i < 20; ++i) {
        slow.push_back(std::make_unique<Connection>(running.server.port()));
        slow.back()->send("POST /api/session HTTP/1.1\r\nX: ");
    }
    const std::jthread dripping([&](const std::stop_token& stop) {
        while (!stop.stop_requested()) {
            for (const auto& connection : slow) connection->send("x");
            std::this_thread::sleep_for(50ms);
        }
    });
    for (int i = 0; i < 3; ++i) {
        std::this_thread::sleep_for(300ms);
        const double start = seconds_now();
        CHECK(is_status(running.exchange(running.request("GET /")), 200));
        CHECK(seconds_now() - start < 5.0);
    }
}

TEST_CASE("a request and an answer have a deadline as a whole", "[view]") {
    view::ServerOptions options;
    options.clients.head_seconds = options.clients.body_seconds = 0.7;
    const Running running(options);
    const std::string head = "POST /api/frame HTTP/1.1\r\nHost: " + running.host() + "\r\n";
    for (const std::string& start : {head + "X: ", head + "Content-Length: 10000\r\n\r\n"}) {
        INFO(start);
        const Connection connection(running.server.port());
        connection.send(start);
        const std::jthread dripping([&](const std::stop_token& stop) {
            while (!stop.stop_requested()) {
                connection.send("x");
                std::this_thread::sleep_for(50ms);
            }
        });
        const double begin = seconds_now();
        static_cast<void>(connection.rest());
        CHECK(seconds_now() - begin < 5.0);
    }
}

TEST_CASE("a server that stops does not wait for a body", "[view]") {
    view::ServerOptions options;
    options.clients.body_seconds = 60.0;
    Running running(options);
    const Connection connection(running.server.port());
    connection.send("POST /api/frame HTTP/1.1\r\nHost: " + running.host() +
                    "\r\nContent-Length: 10000\r\n\r\n");
    const std::jthread dripping([&](const std::stop_token& stop) {
        while (!stop.stop_requested()) {
            connection.send("x");
            std::this_thread::sleep_for(50ms);
        }
    });
    std::this_thread::sleep_for(200ms);
    const double begin = seconds_now();
    running.server.stop();
    CHECK(seconds_now() - begin < 5.0);
}

TEST_CASE("a large body gets the time that it takes", "[view]") {
    view::ServerOptions options;
    options.clients.body_seconds = 0.5;
    const Running running(options);
    const std::string body(std::size_t{512} << 10U, ' ');
    const std::string request = running.request("POST /api/frame", "", body);
    const Connection connection(running.server.port());
    constexpr std::size_t parts = 8;
    for (std::size_t i = 0; i < parts; ++i) {
        connection.send(
            request.substr(i * request.size() / parts,
                           (i + 1) * request.size() / parts - i * request.size() / parts));
        std::this_thread::sleep_for(200ms);
    }
    CHECK(is_status(connection.rest(), 410));  // an unknown session
}

TEST_CASE("clients that read a byte now and then do not keep others out", "[view]") {
    const Running running;  // eight connections at once
    // More answers than the buffers of a connection hold, so that the server has to wait.
    const std::string request = "GET / HTTP/1.1\r\nHost: " + running.host() + "\r\n\r\n";
    std::string requests;
    for (int i = 0; i < 4000; ++i) requests += request;
    std::vector<std::unique_ptr<Connection>> slow;
    for (int i = 0; i < 16; ++i) {
        slow.push_back(std::make_unique<Connection>(running.server.port()));
        slow.back()->send(request);  // at once: who sends nothing may be put out
    }
    std::vector<std::jthread> senders;
    for (const auto& connection : slow) senders.emplace_back([&] { connection->send(requests); });
    for (int i = 0; i < 3; ++i) {
        for (int k = 0; k < 4; ++k) CHECK(slow[static_cast<std::size_t>(k)]->reads_a_byte());
        CHECK(is_status(running.exchange(running.request("GET /")), 200));
    }
    for (const auto& connection : slow) connection->shut_down();
}

TEST_CASE("two hundred pages at once are answered, and the picture of others moves on", "[view]") {
    ViewClient client;
    view::Api api(client.shared(), 201);
    const auto ask = [&](const std::string& path, const std::string& session,
                         const std::string& body) {
        return api({.path = path, .session = session, .query = {}, .body = body});
    };
    const auto open = [&] { return ask("/api/session", "", ""); };
    const auto frame = [&](const view::Answer& opened, double yaw) {
        const nlohmann::json page = nlohmann::json::parse(opened.body);
        const nlohmann::json query = {
            {"face", page["faces"][0]["face"]}, {"quality", "moving"}, {"camera", {{"yaw", yaw}}}};
        return ask("/api/frame", page["session"], query.dump());
    };
    const double start = seconds_now();
    const view::Answer own = open();
    REQUIRE(own.status == 200);
    std::atomic<int> answered = 0;
    std::vector<std::jthread> pages;
    for (int i = 0; i < 200; ++i)
        pages.emplace_back([&, i] {
            const view::Answer opened = open();
            if (opened.status == 200 && frame(opened, 0.1 * i).status == 200) ++answered;
        });
    for (int i = 0; i < 20; ++i) CHECK(frame(own, double(i)).status == 200);
    pages.clear();
    CHECK(answered == 200);
    // A session that has been idle for long gives up its place; under a sanitizer that happens.
    if (seconds_now() - start < 180.0) CHECK(open().status == 503);
}

TEST_CASE("a port that is taken is named", "[view]") {
    Running running;
    view::ServerOptions options;
    options.port = running.server.port();
    view::Server second(std::ref(running.client.api()), options);
    CHECK_THROWS_WITH(second.start(), Catch::Contains("cannot be opened"));
}

TEST_CASE("stymo-view says where its page is and ends with the signal", "[view]") {
    RunningTool running(tiny_run(), "stymo-view",
                        {"--model", "run/model.safetensors", "--port", "0"});
    CHECK(running.says("Open http://127.0.0.1:"));
    running.send(SIGTERM);
    const ToolOutcome outcome = running.wait();
    CHECK(outcome.exit_code == 0);
    CHECK(line_count(outcome.err) == 1);
    const ToolOutcome refused = run_tool(tiny_run(), "stymo-view --model cut.safetensors");
    CHECK(refused.exit_code == 1);
    CHECK(line_count(refused.err) == 1);
    CHECK_THAT(refused.err,
               Catch::StartsWith("stymo-view: ") && Catch::Contains("cut.safetensors"));
}

TEST_CASE("stymo-view takes its token from a file or the environment", "[view]") {
    const TemporaryFile file, empty;
    write_file(file.path(), "from-file\n", Durability::none);
    struct Row {
        std::vector<std::string> options;
        const char* token;
    };
    const std::string name = file.path().string();
    ::setenv("STYMO_TOKEN", "from-environment", 1);
    for (const Row& row : {Row{{}, "from-environment"}, Row{{"--token-file", name}, "from-file"},
                           Row{{"--token-file", name, "--token", "given"}, "given"}}) {
        std::vector<std::string> arguments{"--model", "run/model.safetensors", "--port", "0"};
        arguments.insert(arguments.end(), row.options.begin(), row.options.end());
        RunningTool running(tiny_run(), "stymo-view", arguments);
        CHECK(running.says("/?token=" + std::string(row.token) + " in a browser"));
        running.send(SIGTERM);
        CHECK(running.wait().exit_code == 0);
    }
    ::setenv("STYMO_TOKEN", "a&b", 1);
    const std::string command = "stymo-view --model run/model.safetensors --port 0";
    CHECK_THAT(run_tool(tiny_run(), command).err, Catch::Contains("STYMO_TOKEN: use only letters"));
    ::unsetenv("STYMO_TOKEN");
    CHECK_THAT(run_tool(tiny_run(), command + " --token-file " + empty.path().string()).err,
               Catch::Contains(": holds no token"));
    CHECK(run_tool(tiny_run(), command + " --token-file none").exit_code == 1);
    const ToolOutcome refused = run_tool(tiny_run(), command + " --origin name");
    CHECK(refused.exit_code == 2);
    CHECK(refused.err ==
          "stymo-view: --origin name: not an address such as https://name or "
          "https://name/proxy/8080/; see stymo-view --help\n");
}
