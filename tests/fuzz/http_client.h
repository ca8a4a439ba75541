#pragma once

#include <string>

namespace stymo::fuzz {

/// Sends the bytes to stymo-view's server, which runs in this process, and waits until it closes
/// the connection. "$HOST" in them becomes the server's address. Instead of showing faces, the
/// server parses the bodies. Aborts if the answer is not HTTP.
void send_to_server(std::string bytes);

}  // namespace stymo::fuzz
