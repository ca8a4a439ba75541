#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <filesystem>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/error.h"
#include "core/io/image.h"
#include "fit/photo/alignment.h"
#include "fit/photo/face_detector.h"
#include "fit/photo/face_parser.h"
#include "fit/photo/grab_cut.h"
#include "fit/photo/head_mask.h"
#include "render/parsing_classes.h"

/// How well head masks found by each way agree with hand-made ones, and what finding them costs.
namespace stymo::test {
namespace {

namespace fs = std::filesystem;

struct Arguments {
    fs::path folder;
    std::optional<fs::path> parser;
    std::size_t every = 1;
    bool list = false;
};

Arguments parse(const std::vector<std::string_view>& words) {
    Arguments arguments;
    for (std::size_t i = 0; i < words.size(); ++i) {
        const bool has_value = i + 1 < words.size();
        if (words[i] == "--parser" && has_value) {
            arguments.parser = words[++i];
        } else if (words[i] == "--every" && has_value) {
            arguments.every =
                static_cast<std::size_t>(std::max(1, std::atoi(std::string(words[++i]).c_str())));
        } else if (words[i] == "--list") {
            arguments.list = true;
        } else {
            arguments.folder = words[i];
        }
    }
    if (arguments.folder.empty())
        fail<ValueError>("usage: bench_head_masks FOLDER [--parser ONNX] [--every N] [--list]");
    return arguments;
}

double processor_seconds() {
    return static_cast<double>(std::clock()) / CLOCKS_PER_SEC;
}

class Sums {
public:
    template <class Function>
    auto time(const std::string& name, const Function& function) {
        const double start = processor_seconds();
        auto result = function();
        add("cpu_ms." + name, 1e3 * (processor_seconds() - start));
        return result;
    }

    void add(const std::string& name, double value) {
        auto& [sum, count] = sums_[name];
        sum += value;
        ++count;
    }

    void print(std::size_t photos, std::size_t with_face, std::size_t aligned) const {
        std::printf("{\"photos\": %zu, \"with_face\": %zu, \"aligned\": %zu", photos, with_face,
                    aligned);
        for (const auto& [name, entry] : sums_)
            std::printf(",\n \"%s\": %.4f", name.c_str(),
                        entry.first / static_cast<double>(entry.second));
        std::printf("}\n");
    }

private:
    std::map<std::string, std::pair<double, std::size_t>> sums_;
};

Tensor head_classes(Tensor classes) {
    for (float& value : classes.mutable_values<float>())
        value = is_head_class(static_cast<int>(value)) ? 1.0F : 0.0F;
    return classes;
}

void run(const Arguments& arguments) {
    std::vector<fs::path> files;
    for (const fs::directory_entry& entry : fs::directory_iterator(arguments.folder / "images"))
        files.push_back(entry.path());
    std::sort(files.begin(), files.end());
    const FaceDetector detector;
    std::optional<FaceParser> parser;
    if (arguments.parser) parser.emplace(*arguments.parser);
    Sums sums;
    std::size_t photos = 0, with_face = 0, aligned = 0;
    for (std::size_t i = 0; i < files.size(); i += arguments.every) {
        const std::string id = files[i].stem().string();
        const Tensor photo = read_image(files[i]);
        const Tensor parsing = read_class_map(arguments.folder / "parsing" / (id + ".png"));
        const Tensor truth = head_classes(parsing);
        ++photos;
        const auto faces = sums.time("detection", [&] { return detector.find(photo); });
        if (faces.empty()) continue;
        ++with_face;
        const Landmarks& landmarks = faces.front().landmarks;
        if (is_aligned(ffhq_alignment(landmarks), photo.shape(1), photo.shape(0))) ++aligned;
        const auto judge = [&](const std::string& name, const Tensor& mask) {
            const double agreement = intersection_over_union(mask, truth);
            sums.add("iou." + name, agreement);
            if (arguments.list) std::printf("%s %s %.4f\n", id.c_str(), name.c_str(), agreement);
        };
        judge("grab_cut",
              sums.time("grab_cut", [&] { return grab_cut_head_mask(photo, landmarks); }));
        if (!parser) continue;
        const Tensor classes = sums.time("parser", [&] { return parser->parse(photo); });
        judge("parser_as_it_is", head_classes(classes));
        const Tensor mask = sums.time("clean_up", [&] { return head_mask_from_parsing(classes); });
        judge("parser_and_clean_up", mask);
        const Tensor mended =
            sums.time("parser_and_grab_cut", [&] { return parser->head_mask(photo, landmarks); });
        judge("parser_and_grab_cut", mended);
        const Tensor cleaned_truth = head_mask_from_parsing(parsing);
        sums.add("iou_with_cleaned.parser", intersection_over_union(mask, cleaned_truth));
        sums.add("iou_with_cleaned.parser_and_grab_cut",
                 intersection_over_union(mended, cleaned_truth));
    }
    sums.print(photos, with_face, aligned);
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
