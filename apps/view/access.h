#pragma once

#include <cstddef>
#include <optional>
#include <set>
#include <string>
#include <vector>

namespace stymo::view {

/// Limits on what one client can take from the others.
struct ClientLimits {
    std::size_t connections = 128;  ///< served at once; further ones wait
    double read_seconds = 10.0;     ///< largest time between two bytes
    double head_seconds = 10.0;     ///< largest time for the head of a request, from its first byte
    /// Largest time for the body of a request, and again for its answer. A body or an answer gets
    /// one second more for each 64 KiB.
    double body_seconds = 30.0;
};

/// 128 random bits from the operating system as hexadecimal digits.
[[nodiscard]] std::string random_token();

/// Where a browser finds the page if it is behind a proxy.
struct PageAddress {
    std::string origin;  ///< as browsers send it: "https://name", "http://name:9000"
    std::string path;    ///< begins and ends with '/'
};

/// Of a URL such as "https://name/proxy/8080/". Throws UsageError for other texts.
[[nodiscard]] PageAddress page_address(const std::string& url);

/// What a request says about who asks; empty where it says nothing.
struct Asker {
    std::string host{};
    std::optional<std::string> origin{};
    std::string site{};             ///< Sec-Fetch-Site
    std::string forwarded_host{};   ///< X-Forwarded-Host
    std::string forwarded_proto{};  ///< X-Forwarded-Proto
    std::string token{};
    bool reads_page = false;  ///< asks for a file of the page, which is no secret
};

struct Refusal {
    int status = 403;
    std::string reason;
};

/// Decides who is answered: the page that this server has served, and no other. A page of another
/// site cannot choose the Origin that the browser sends; one whose name resolves to this machine
/// (DNS rebinding) cannot choose the Host. Who can reach the server by another name needs the
/// token, which no other page knows.
class Access {
public:
    /// `host` is the address that the server listens on; `addresses` are those of the page behind
    /// proxies; with `trusts_proxy` the X-Forwarded headers are believed. Makes a random token if
    /// there is none and others can reach the server.
    Access(const std::string& host, std::string token, std::vector<PageAddress> addresses,
           bool trusts_proxy);

    /// Nothing if the request is answered.
    [[nodiscard]] std::optional<Refusal> refusal(const Asker& asker) const;
    /// Empty: none is needed.
    [[nodiscard]] const std::string& token() const { return token_; }
    [[nodiscard]] const std::vector<PageAddress>& addresses() const { return addresses_; }
    /// The paths of the addresses behind a proxy that have this Host.
    [[nodiscard]] std::set<std::string> paths_on(const std::string& host) const;

private:
    [[nodiscard]] bool is_own_name(const std::string& host) const;
    [[nodiscard]] bool is_own_page(const Asker& asker) const;

    bool is_local_;
    std::string token_;
    std::vector<PageAddress> addresses_;
    bool trusts_proxy_;
};

}  // namespace stymo::view
