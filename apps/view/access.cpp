#include "apps/view/access.h"

#include <algorithm>
#include <cctype>
#include <random>
#include <regex>

#include "apps/common/command_line.h"
#include "core/error.h"

namespace stymo::view {

std::string random_token() {
    constexpr const char* digits = "0123456789abcdef";
    constexpr int length = 32;
    std::random_device source;
    std::uniform_int_distribution<int> digit(0, 15);
    std::string token;
    for (int i = 0; i < length; ++i) token += digits[digit(source)];
    return token;
}

namespace {

/// Browsers leave out the usual port of a scheme.
std::string origin_of(const std::string& scheme, std::string host) {
    const std::string usual_port = scheme == "https" ? ":443" : ":80";
    if (host.ends_with(usual_port)) host.resize(host.size() - usual_port.size());
    return scheme + "://" + host;
}

/// Whether a Host is a name of the machine itself, with any port: ssh and editors forward others.
bool is_loopback(const std::string& host) {
    static const std::regex form(R"((127\.0\.0\.1|localhost|\[::1\])(:[0-9]{1,5})?)");
    constexpr std::size_t longest = 32;
    return host.size() <= longest && std::regex_match(host, form);
}

/// Takes constant time for texts of the same length.
bool equal_tokens(const std::string& a, const std::string& b) {
    unsigned difference = a.size() == b.size() ? 0U : 1U;
    for (std::size_t i = 0; i < std::min(a.size(), b.size()); ++i)
        difference |= static_cast<unsigned>(a[i] ^ b[i]);
    return difference == 0;
}

/// The first of a list, which the proxy next to the browser has written.
std::string first_of(const std::string& list) {
    return list.substr(0, list.find(','));
}

}  // namespace

PageAddress page_address(const std::string& url) {
    static const std::regex form(
        R"((https?)://((?:[a-z0-9._-]+|\[[0-9a-f:.]+\])(?::[0-9]{1,5})?)(/[a-z0-9._~@/-]*)?)",
        std::regex::icase);
    constexpr std::size_t longest = 2000;
    std::smatch parts;
    if (url.size() > longest || !std::regex_match(url, parts, form))
        fail<UsageError>("--origin ", url,
                         ": not an address such as https://name or https://name/proxy/8080/");
    const auto lower = [](std::string text) {
        std::ranges::transform(text, text.begin(), [](unsigned char c) { return std::tolower(c); });
        return text;
    };
    std::string path = parts[3];
    if (!path.ends_with('/')) path += '/';
    return {origin_of(lower(parts[1]), lower(parts[2])), path};
}

Access::Access(const std::string& host, std::string token, std::vector<PageAddress> addresses,
               bool trusts_proxy)
    : is_local_(host == "::1" || is_loopback(host)),
      token_(std::move(token)),
      addresses_(std::move(addresses)),
      trusts_proxy_(trusts_proxy) {
    if (token_.empty() && (!is_local_ || trusts_proxy_ || !addresses_.empty()))
        token_ = random_token();
}

std::set<std::string> Access::paths_on(const std::string& host) const {
    std::set<std::string> paths;
    for (const PageAddress& address : addresses_)
        if (address.origin == origin_of("https", host) || address.origin == origin_of("http", host))
            paths.insert(address.path);
    return paths;
}

bool Access::is_own_name(const std::string& host) const {
    // The machine or its proxy may have names that the server does not know; the token decides.
    if (!is_local_ || trusts_proxy_) return true;
    return is_loopback(host) || !paths_on(host).empty();
}

bool Access::is_own_page(const Asker& asker) const {
    const std::string& origin = *asker.origin;
    if (std::ranges::find(addresses_, origin, &PageAddress::origin) != addresses_.end())
        return true;
    if (trusts_proxy_ && !asker.forwarded_proto.empty()) {
        const std::string& name = asker.forwarded_host.empty() ? asker.host : asker.forwarded_host;
        return origin == origin_of(first_of(asker.forwarded_proto), first_of(name));
    }
    if (!is_loopback(asker.host) && !paths_on(asker.host).empty()) return false;
    // Proxies that encrypt say so only in headers that anybody can write, hence the token.
    return origin == origin_of("http", asker.host) ||
           (!token_.empty() && origin == origin_of("https", asker.host));
}

std::optional<Refusal> Access::refusal(const Asker& asker) const {
    if (!is_own_name(asker.host))
        return Refusal{403,
                       "this name is not the viewer's; if it is that of its proxy, start "
                       "stymo-view with --origin and the page's address"};
    if (asker.origin && !is_own_page(asker))
        return Refusal{403, "requests of the page " + *asker.origin + " are not answered" +
                                (*asker.origin == "null"
                                     ? ""
                                     : "; if it is the viewer's own, behind a proxy, start "
                                       "stymo-view with --origin " +
                                           *asker.origin)};
    if (asker.reads_page) return std::nullopt;
    const bool is_of_other_page =
        !asker.site.empty() && asker.site != "same-origin" && asker.site != "none";
    if (is_of_other_page) return Refusal{403, "requests of other pages are not answered"};
    if (!token_.empty() && !equal_tokens(asker.token, token_))
        return Refusal{401, "the token is missing or wrong; open the address that was printed"};
    return std::nullopt;
}

}  // namespace stymo::view
