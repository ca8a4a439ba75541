// Who the viewer answers, by the headers of a request.
#include <catch2/catch.hpp>
#include <set>

#include "apps/common/command_line.h"
#include "apps/view/access.h"

using namespace stymo;
using view::Access;
using view::Asker;

namespace access_tests {

constexpr const char* token = "secret";

int status(const Access& access, const Asker& asker) {
    const auto refusal = access.refusal(asker);
    return refusal ? refusal->status : 200;
}

Access local() {
    return {"127.0.0.1", "", {}, false};
}

Access behind_proxy() {
    return {"127.0.0.1",
            token,
            {view::page_address("https://Name.Example/proxy/8080"),
             view::page_address("http://localhost:8080")},
            false};
}

}  // namespace access_tests

using namespace access_tests;

TEST_CASE("the address of a page behind a proxy is what browsers send, and a path", "[view]") {
    const auto check = [](const std::string& url, const std::string& origin,
                          const std::string& path) {
        INFO(url);
        const view::PageAddress address = view::page_address(url);
        CHECK(address.origin == origin);
        CHECK(address.path == path);
    };
    check("https://name", "https://name", "/");
    check("HTTPS://Name.Example:443/", "https://name.example", "/");
    check("http://name:80", "http://name", "/");
    check("http://name:443", "http://name:443", "/");
    check("https://[2001:db8::1]:9000", "https://[2001:db8::1]:9000", "/");
    check("https://name/user/a@b/proxy/8080", "https://name", "/user/a@b/proxy/8080/");
    for (const char* url : {"", "name", "name:8080", "ftp://name", "https://", "https://a b",
                            "https://name/?token=x", "https://user@name", "https://name:123456",
                            "https://name/\"><script>", "https://name\r\nX: y", "null", "*"}) {
        INFO(url);
        CHECK_THROWS_AS(view::page_address(url), UsageError);
    }
}

TEST_CASE("a viewer of this machine is reached by its own names alone, at any port", "[view]") {
    const Access access = local();
    CHECK(access.token().empty());
    for (const char* host : {"127.0.0.1:8080", "localhost:9000", "[::1]:9000", "localhost"}) {
        INFO(host);
        const std::string name = host;
        CHECK(status(access, {.host = name}) == 200);
        CHECK(status(access, {.host = name, .origin = "http://" + name}) == 200);
        for (const std::string& origin :
             {std::string("http://evil.example"), std::string("null"), std::string(),
              std::string("http://localhost:3000"), "https://" + name, "http://" + name + "0"}) {
            INFO(origin);
            CHECK(status(access, {.host = name, .origin = origin}) == 403);
        }
    }
    for (const char* host :
         {"evil.example", "evil.example:8080", "localhost.evil.example:8080", "127.0.0.1.nip.io",
          "localhost:x", "localhost:", "localhost:80800000", "localhost@evil.example", "[::2]:8080",
          "127.0.0.2", "0.0.0.0:8080", "", "localhost:8080:8080"}) {
        INFO(host);
        const std::string name = host;
        CHECK(status(access, {.host = name}) == 403);
        CHECK(status(access, {.host = name, .origin = "http://" + name}) == 403);
        CHECK(status(access, {.host = name, .reads_page = true}) == 403);
    }
}

TEST_CASE("the browser's word that another page asks is enough to refuse", "[view]") {
    for (const char* site : {"cross-site", "same-site"}) {
        INFO(site);
        CHECK(status(local(), {.host = "localhost:8080", .site = site}) == 403);
        // A link on another page may lead to the viewer's.
        CHECK(status(local(), {.host = "localhost:8080", .site = site, .reads_page = true}) == 200);
    }
    for (const char* site : {"same-origin", "none", ""})
        CHECK(status(local(), {.host = "localhost:8080", .site = site}) == 200);
}

TEST_CASE("a page behind a proxy is answered if it has the token", "[view]") {
    const Access access = behind_proxy();
    struct Row {
        const char* why;
        Asker asker;
        int status;
    };
    const std::vector<Row> rows{
        {"the proxy keeps the name",
         {.host = "name.example", .origin = "https://name.example", .token = token},
         200},
        {"and adds the usual port",
         {.host = "name.example:443", .origin = "https://name.example", .token = token},
         200},
        {"the proxy has its own name for the viewer",
         {.host = "127.0.0.1:8080", .origin = "https://name.example", .token = token},
         200},
        {"the proxy changes the origin, which was named",
         {.host = "name.example", .origin = "http://localhost:8080", .token = token},
         200},
        {"directly", {.host = "[::1]:80", .origin = "http://[::1]", .token = token}, 200},
        {"through an editor's tunnel with its own certificate",
         {.host = "localhost:9000", .origin = "https://localhost:9000", .token = token},
         200},
        {"a script", {.host = "name.example", .token = token}, 200},
        {"no token", {.host = "name.example", .origin = "https://name.example"}, 401},
        {"a wrong token",
         {.host = "name.example", .origin = "https://name.example", .token = "Secret"},
         401},
        {"no token, no origin", {.host = "127.0.0.1:8080"}, 401},
        {"the page has no token yet", {.host = "name.example", .reads_page = true}, 200},
        {"a foreign page with the token",
         {.host = "name.example", .origin = "https://evil.example", .token = token},
         403},
        {"the same name without encryption",
         {.host = "name.example", .origin = "http://name.example", .token = token},
         403},
        {"another port", {.host = "name.example:8443", .token = token}, 403},
        {"a name that leads here",
         {.host = "evil.example", .origin = "http://evil.example", .token = token},
         403},
        {"a name that leads here and claims a proxy",
         {.host = "evil.example",
          .origin = "https://name.example",
          .forwarded_host = "name.example",
          .forwarded_proto = "https",
          .token = token},
         403},
        {"a proxy that is not trusted",
         {.host = "127.0.0.1:8080",
          .origin = "https://other.example",
          .forwarded_host = "other.example",
          .forwarded_proto = "https",
          .token = token},
         403},
    };
    for (const Row& row : rows) {
        INFO(row.why);
        CHECK(status(access, row.asker) == row.status);
    }
    CHECK(access.refusal(rows.at(11).asker)->reason ==
          "requests of the page https://evil.example are not answered; if it is the viewer's own, "
          "behind a proxy, start stymo-view with --origin https://evil.example");
}

TEST_CASE("a page may have several addresses of one name", "[view]") {
    const Access access("127.0.0.1", token,
                        {view::page_address("https://name.example"),
                         view::page_address("https://name.example/proxy/8080/"),
                         view::page_address("http://name.example/proxy/8080/"),
                         view::page_address("https://name.example:8443/proxy/8080/")},
                        false);
    using Paths = std::set<std::string>;
    CHECK(access.paths_on("name.example") == Paths{"/", "/proxy/8080/"});
    CHECK(access.paths_on("name.example:8443") == Paths{"/proxy/8080/"});
    CHECK(access.paths_on("other.example").empty());
    for (const char* origin : {"https://name.example", "http://name.example"})
        CHECK(status(access, {.host = "name.example", .origin = origin, .token = token}) == 200);
    CHECK(status(access, {.host = "name.example:8443",
                          .origin = "https://name.example:8443",
                          .token = token}) == 200);
    CHECK(status(access, {.host = "name.example:8443",
                          .origin = "http://name.example:8443",
                          .token = token}) == 403);
}

TEST_CASE("a trusted proxy says where the page is; the token is needed all the same", "[view]") {
    const Access access("127.0.0.1", token, {}, true);
    const Asker forwarded{.host = "127.0.0.1:8080",
                          .origin = "https://name.example",
                          .forwarded_host = "name.example",
                          .forwarded_proto = "https",
                          .token = token};
    CHECK(status(access, forwarded) == 200);
    const auto with = [&](auto change) {
        Asker asker = forwarded;
        change(asker);
        return status(access, asker);
    };
    CHECK(with([](Asker& a) { a.forwarded_host = "name.example:443"; }) == 200);
    CHECK(with([](Asker& a) { a.forwarded_host = "name.example, 10.0.0.1"; }) == 200);
    CHECK(with([](Asker& a) { a.host = "name.example", a.forwarded_host = ""; }) == 200);
    CHECK(with([](Asker& a) { a.forwarded_proto = "http"; }) == 403);
    CHECK(with([](Asker& a) { a.forwarded_host = "evil.example"; }) == 403);
    CHECK(with([](Asker& a) { a.origin = "https://evil.example"; }) == 403);
    CHECK(with([](Asker& a) { a.token = ""; }) == 401);
    // A page whose name leads here can write these headers, but not the token.
    CHECK(with([](Asker& a) {
              a = {.host = "evil.example",
                   .origin = "http://evil.example",
                   .forwarded_host = "evil.example",
                   .forwarded_proto = "http"};
          }) == 401);
}

TEST_CASE("whoever can be reached by others has a token", "[view]") {
    CHECK(local().token().empty());
    CHECK(Access("::1", "", {}, false).token().empty());
    CHECK(Access("0.0.0.0", "", {}, false).token().size() == 32);
    CHECK(Access("127.0.0.1", "", {}, true).token().size() == 32);
    CHECK(Access("127.0.0.1", "", {view::page_address("https://name")}, false).token().size() ==
          32);
    // On a network the machine may have any name; then encryption may end before it.
    const Access open("0.0.0.0", token, {}, false);
    CHECK(status(open, {.host = "pc", .origin = "http://pc", .token = token}) == 200);
    CHECK(status(open, {.host = "pc", .origin = "https://pc", .token = token}) == 200);
    CHECK(status(open, {.host = "pc", .origin = "https://evil.example", .token = token}) == 403);
    CHECK(status(open, {.host = "pc", .origin = "http://pc"}) == 401);
}
