#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <functional>
#include <iostream>
#include <string_view>
#include <thread>

#include "apps/common/command_line.h"
#include "apps/common/tool_options.h"
#include "apps/common/tools.h"
#include "apps/view/server.h"
#include "core/error.h"
#include "core/interrupt.h"
#include "core/io/file.h"

namespace {

struct Options {
    stymo::view::ViewerOptions viewer;
    stymo::view::ServerOptions server;
    std::string token_file;
    int most_sessions = 32;
    std::string mode = "skip";
};

constexpr const char* token_variable = "STYMO_TOKEN";

/// The token is part of an address.
void require_plain(const std::string& token, const std::string& source) {
    constexpr std::string_view plain =
        "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789._~-";
    if (token.find_first_not_of(plain) != std::string::npos)
        stymo::fail<stymo::UsageError>(source, ": use only letters, digits and . _ ~ -");
}

/// From --token, else from --token-file, else from the environment; empty if there is none.
std::string chosen_token(const Options& options) {
    std::string token = options.server.token, source = "--token";
    if (token.empty() && !options.token_file.empty()) {
        source = options.token_file;
        token = stymo::read_file(options.token_file);
        while (token.ends_with('\n') || token.ends_with('\r')) token.pop_back();
        if (token.empty()) stymo::fail<stymo::FileError>(source, ": holds no token");
    } else if (const char* set = std::getenv(token_variable); token.empty() && set != nullptr) {
        source = token_variable;
        token = set;
    }
    require_plain(token, source);
    return token;
}

stymo::AppResult serve(Options options) {
    using std::chrono_literals::operator""ms;
    options.server.token = chosen_token(options);
    // A photo of phones and cameras has less than a byte for each pixel.
    options.server.most_body_bytes = std::max(
        options.server.most_body_bytes, static_cast<std::size_t>(options.viewer.most_photo_pixels));
    options.viewer.frames.moving_mode = stymo::render_mode(options.mode);
    const stymo::InterruptGuard guard;
    stymo::view::SharedState shared(options.viewer);
    stymo::view::Api api(shared, static_cast<std::size_t>(options.most_sessions));
    stymo::view::Server server(std::ref(api), options.server);
    server.start();
    std::cerr << "Open " << server.address() << " in a browser. Ctrl-C ends the viewer."
              << std::endl;
    while (!stymo::interrupted()) std::this_thread::sleep_for(100ms);
    server.stop();
    return {};
}

}  // namespace

int stymo_view(int argc, char** argv) {
    Options options;
    stymo::CommandLine line("stymo-view",
                            "Shows faces in a web browser: turns, mixes, recolours and fits them. "
                            "Serves its page on this machine alone unless told otherwise.");
    stymo::declare_model(line, options.viewer.model);
    line.option("--codes", options.viewer.codes,
                "codes.json of a face to begin with; may be repeated (default: drawn faces)");
    line.requiring("--codes", [&] { stymo::declare_tuned(line, options.viewer.model); });
    line.option("--parser", options.viewer.parser,
                "ONNX file of a face parser, which finds the part to recolour (default: the "
                "region of similar colour)");
    line.option("--port", options.server.port, "port of the page; 0: any that is free")
        .range(0, 65535);
    line.option("--host", options.server.host,
                "address to listen on; any but this machine's own needs the token that is printed");
    line.option("--origin", options.server.origins,
                "address of the page behind a proxy or tunnel, as the browser sees it: "
                "https://name or https://name/proxy/8080/; may be repeated; needs the token");
    line.flag("--trust-proxy", options.server.trusts_proxy,
              "believe a proxy's X-Forwarded-Host and X-Forwarded-Proto instead; needs the token");
    line.option("--token", options.server.token,
                "secret that requests must bring: letters, digits and . _ ~ -; other users of this "
                "machine see it in the list of processes");
    line.option("--token-file", options.token_file,
                "file that holds the token, unseen by others (default: the environment variable "
                "STYMO_TOKEN)");
    line.option("--mode", options.mode, "how moving images are rendered")
        .one_of(stymo::render_mode_names());
    line.option("--psnr", options.viewer.frames.psnr,
                "error of moving images against exact ones, in decibels")
        .range(20, 90);
    line.option("--fit-steps", options.viewer.fit_steps, "steps of fitting a photo")
        .range(1, 10000);
    line.option("--color-steps", options.viewer.color_steps, "steps of recolouring a part")
        .range(1, 10000);
    line.option("--max-pixels", options.viewer.most_photo_pixels,
                "photos with more pixels are refused; a file may have as many bytes, at least 64 "
                "MiB")
        .range(1, 1e12);
    line.option("--sessions", options.most_sessions, "largest number of open pages").range(1, 1000);
    return line.run(argc, argv, [&](const stymo::CommonOptions&) { return serve(options); });
}
