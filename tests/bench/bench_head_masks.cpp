#include <algorithm>
#include <array>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <filesystem>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "core/error.h"
#include "core/io/image.h"
#include "fit/photo/head_mask.h"
#include "nn/pretrained/head_mask_network.h"
#include "render/parsing_classes.h"

/// How well the head masks of a network agree with hand-made ones, for all photos and by kind, and
/// the processor time of a mask. With --out it writes the masks.
namespace stymo::test {
namespace {

namespace fs = std::filesystem;

struct Arguments {
    fs::path folder, network, out;
    std::size_t from = 0;
    std::size_t to = 1'000'000'000;
    bool list = false;
};

Arguments parse(const std::vector<std::string_view>& words) {
    Arguments arguments;
    for (std::size_t i = 0; i < words.size(); ++i) {
        const std::string value(i + 1 < words.size() ? words[i + 1] : "");
        if (words[i] == "--network")
            arguments.network = value, ++i;
        else if (words[i] == "--out")
            arguments.out = value, ++i;
        else if (words[i] == "--from")
            arguments.from = std::strtoul(value.c_str(), nullptr, 10), ++i;
        else if (words[i] == "--to")
            arguments.to = std::strtoul(value.c_str(), nullptr, 10), ++i;
        else if (words[i] == "--list")
            arguments.list = true;
        else
            arguments.folder = words[i];
    }
    if (arguments.folder.empty() || arguments.network.empty())
        fail<ValueError>(
            "usage: bench_head_masks FOLDER --network FILE [--from N] [--to N] [--list] [--out "
            "FOLDER]");
    return arguments;
}

/// The kinds to which a photo belongs, by its hand-made class map.
std::vector<std::string> kinds_of(const Tensor& photo, const Tensor& parsing) {
    std::array<double, 19> share{};
    std::array<double, 19> light{};
    const auto classes = parsing.values<float>();
    const auto colors = photo.values<float>();
    const std::int64_t side = parsing.shape(0);
    const bool same_size = photo.shape(0) == side;
    std::int64_t chin = 0, low_hair = 0;
    for (std::size_t i = 0; i < classes.size(); ++i) {
        const auto index = static_cast<std::size_t>(classes[i]);
        share[index] += 1.0 / static_cast<double>(classes.size());
        if (same_size)
            light[index] += static_cast<double>(0.3F * colors[3 * i] + 0.59F * colors[3 * i + 1] +
                                                0.11F * colors[3 * i + 2]);
        if (index == 1) chin = std::max(chin, static_cast<std::int64_t>(i) / side);
    }
    for (std::size_t i = 0; i < classes.size(); ++i)
        if (classes[i] == 13.0F && static_cast<std::int64_t>(i) / side > chin) ++low_hair;
    std::vector<std::string> kinds{"all"};
    const double skin = share[1] * static_cast<double>(classes.size());
    if (share[10] > 0.004) kinds.emplace_back("open mouth");
    if (same_size && light[1] / std::max(1.0, skin) < 0.38) kinds.emplace_back("dark skin");
    if (share[13] < 0.03 && share[14] == 0.0) kinds.emplace_back("bald");
    if (share[3] > 0.0) kinds.emplace_back("glasses");
    if (static_cast<double>(low_hair) > 0.01 * static_cast<double>(classes.size()))
        kinds.emplace_back("long hair");
    if (share[14] > 0.01) kinds.emplace_back("hat");
    return kinds;
}

void run(const Arguments& arguments) {
    std::vector<fs::path> files;
    for (const fs::directory_entry& entry : fs::directory_iterator(arguments.folder / "images"))
        files.push_back(entry.path());
    std::sort(files.begin(), files.end());
    const HeadMaskModel model = read_head_mask_model(arguments.network);
    if (!arguments.out.empty()) fs::create_directories(arguments.out);
    std::map<std::string, std::vector<double>> overlaps;
    double seconds = 0.0;
    std::size_t count = 0;
    for (std::size_t i = arguments.from; i < std::min(files.size(), arguments.to + 1); ++i) {
        const std::string name = files[i].stem().string() + ".png";
        const Tensor photo = read_image(files[i]);
        const std::clock_t start = std::clock();
        const Tensor mask = head_mask(model, photo);
        seconds += static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC;
        ++count;
        if (!arguments.out.empty()) write_image(arguments.out / name, mask);
        const fs::path parsing_file = arguments.folder / "parsing" / name;
        if (!fs::exists(parsing_file)) continue;
        const Tensor parsing = read_class_map(parsing_file);
        Tensor truth = parsing;
        for (float& value : truth.mutable_values<float>())
            value = is_head_class(static_cast<int>(value)) ? 1.0F : 0.0F;
        const double overlap = intersection_over_union(mask, truth);
        if (arguments.list) std::printf("%s %.4f\n", name.c_str(), overlap);
        for (const std::string& kind : kinds_of(photo, parsing)) overlaps[kind].push_back(overlap);
    }
    std::printf("{\"cpu_ms\": %.1f",
                1e3 * seconds / static_cast<double>(std::max<std::size_t>(1, count)));
    for (auto& [kind, values] : overlaps) {
        double sum = 0.0;
        for (const double value : values) sum += value;
        std::printf(",\n \"%s\": {\"photos\": %zu, \"mean_iou\": %.4f}", kind.c_str(),
                    values.size(), sum / static_cast<double>(values.size()));
    }
    std::printf("}\n");
}

}  // namespace
}  // namespace stymo::test

int main(int argc, char** argv) {
    try {
        stymo::test::run(stymo::test::parse({argv + 1, argv + argc}));
    } catch (const std::exception& error) {
        std::fprintf(stderr, "bench_head_masks: %s\n", error.what());
        return 1;
    }
}
