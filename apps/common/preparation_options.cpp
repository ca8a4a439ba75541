#include "apps/common/preparation_options.h"

#include <iostream>

#include "apps/common/shipped_file.h"

namespace stymo {

void declare_preparation_files(Command& command, PhotoPreparationSettings& settings) {
    settings.landmark_model = shipped_landmark_network();
    command.option("--parser", settings.parser,
                   "face parser in an ONNX file, for head masks (default: GrabCut)");
    command.option("--morphable", settings.morphable,
                   "head model that is fitted for pose and codes: a .safetensors file or a folder "
                   "of ICT-FaceKit (default: the built-in head)");
    command.option(
        "--landmarks", settings.landmark_model,
        "predictor of 68 landmarks: a .safetensors file of stymo-landmarks, or dlib's "
        "shape_predictor (default: the network that comes with stymo, else the model of Debian's "
        "libdlib-data)");
    command.option("--pose-net", settings.pose_network,
                   "pose network in an ONNX file, 3DDFA_V2 or 6DRepNet; its pose replaces that of "
                   "the fitted head");
    command
        .option("--max-pixels", settings.most_pixels,
                "unprepared photos with more pixels are refused")
        .range(1, 1e12);
}

void warn_without_landmark_network(const PhotoPreparationSettings& settings) {
    if (settings.landmark_model.empty())
        std::cerr << "warning: the landmark network that comes with stymo was not found near the "
                     "program, so dlib's landmarks are used; name the network with --landmarks"
                  << std::endl;
}

}  // namespace stymo
