// Fits the face in a photo and renders it turned by 25 degrees: embed PHOTO OUT.png
#include <iostream>

#include "core/error.h"
#include "core/io/image.h"
#include "fit/studio.h"

int main(int argc, char** argv) {
    if (argc != 3) {
        std::cerr << "usage: embed PHOTO OUT.png\n";
        return 2;
    }
    try {
        // CMake's target stymo::stymo defines STYMO_CONFIGS, the folder of the installed models.
        const stymo::Studio studio({}, STYMO_CONFIGS);
        stymo::FitJobOptions options = studio.fit_options();
        options.fit.steps = 30;
        const stymo::StudioFace face = studio.fit(stymo::read_image(argv[1]), options);
        std::cout << "fitted with " << *face.psnr << " dB\n";

        const stymo::View view = studio.render(face, {.yaw = 25.0});
        // (side, side, 3), row by row, in [0, 1]
        const std::span<const float> buffer = view.image.values<float>();
        std::cout << view.image.shape() << ", first value " << buffer[0] << '\n';
        stymo::write_image(argv[2], view.image);
    } catch (const stymo::Error& error) {
        std::cerr << "embed: " << error.what() << '\n';
        return 1;
    }
}
